/* The program that started this one, on a socket: it knows the room.
 *
 * A message is a letter, its size (u32) and that many bytes, little-endian.
 *   to the parent    U name of the pseudo-terminal
 *                    P degrees f64, seconds f64, sweep u16, ping u8: what is heard there, and then?
 *   from the parent  E count u32, count times f64, rate f64, start f64, samples u32, that many f32
 *                    R reset the board · H make it hang · S slip: microsteps f64 · W wedge: seconds f64
 *                    C how long did interrupt handlers take? answered with C, cycles u32 of each vector
 */
#include <errno.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "emulator.h"

static int parent = -1;

void parent_start(int descriptor) { parent = descriptor; }

static void write_all(const void *bytes, size_t size)
{
    for (const char *at = bytes; size;) {
        ssize_t written = write(parent, at, size);
        if (written < 0 && (errno != EINTR || asked_to_end()))
            switch_off(); // the parent has gone, or wants the board gone
        at += written > 0 ? written : 0;
        size -= written > 0 ? (size_t)written : 0;
    }
}

static void read_all(void *bytes, size_t size)
{
    for (char *at = bytes; size;) {
        ssize_t got = read(parent, at, size);
        if (got == 0 || (got < 0 && (errno != EINTR || asked_to_end())))
            switch_off(); // the parent has gone, or wants the board gone
        at += got > 0 ? got : 0;
        size -= got > 0 ? (size_t)got : 0;
    }
}

static void send_message(char kind, const void *bytes, uint32_t size)
{
    write_all(&kind, 1);
    write_all(&size, 4);
    write_all(bytes, size);
}

void parent_tell_ready(const char *url) { send_message('U', url, (uint32_t)strlen(url)); }

static double read_double(void)
{
    double value;
    read_all(&value, sizeof value);
    return value;
}

static uint32_t read_count(void)
{
    uint32_t count;
    read_all(&count, sizeof count);
    return count;
}

static void read_heard(struct heard *heard)
{
    heard->count = read_count();
    if (heard->count > ECHOES_MOST)
        die("more echoes than fit");
    read_all(heard->times, heard->count * sizeof(double));
    heard->rate = read_double();
    heard->start = read_double();
    heard->samples = read_count();
    heard->trace = realloc(heard->trace, heard->samples * sizeof(float) + 1);
    if (!heard->trace)
        die("no memory");
    read_all(heard->trace, heard->samples * sizeof(float));
}

// Take one message; true where it was what is heard.
static bool take(avr_t *avr, struct heard *heard)
{
    char kind;
    read_all(&kind, 1);
    read_count();
    switch (kind) {
    case 'E':
        if (!heard)
            die("echoes nobody asked for");
        read_heard(heard);
        return true;
    case 'R':
        reset_board(avr);
        return false;
    case 'H':
        hang_board(avr);
        return false;
    case 'S':
        turntable_slip(read_double());
        return false;
    case 'W':
        turntable_wedge(avr, read_double());
        return false;
    case 'C':
        send_message('C', longest_interrupts(), INTERRUPTS * sizeof(uint32_t));
        return false;
    default:
        die("a message that is none");
        return false;
    }
}

void parent_poll(avr_t *avr)
{
    struct pollfd waiting = {.fd = parent, .events = POLLIN};
    while (parent >= 0 && poll(&waiting, 1, 0) > 0)
        take(avr, NULL);
}

void parent_hear(avr_t *avr, const struct ping *ping, struct heard *heard)
{
    if (parent < 0) {
        heard->count = heard->samples = 0;
        return;
    }
    char bytes[19];
    double now = seconds(avr);
    memcpy(bytes, &ping->degrees, 8);
    memcpy(bytes + 8, &now, 8);
    memcpy(bytes + 16, &ping->sweep, 2);
    bytes[18] = (char)ping->index;
    send_message('P', bytes, sizeof bytes);
    while (!take(avr, heard))
        ;
}
