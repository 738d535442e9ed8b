/* Socket to the process that started the emulator. It computes the echoes.
 *
 * A message is a letter, its size (u32) and that many bytes, little-endian.
 *   to the parent    U name of the pseudo-terminal
 *                    P degrees f64, seconds f64, sweep u16, ping u8: request the echoes of a ping
 *   from the parent  E count u32, count times f64, rate f64, start f64, samples u32, that many f32
 *                    R reset the board · H make it hang · S slip: microsteps f64 · W wedge: seconds f64
 *                    M wiring faults u32
 *                    C request the longest duration of interrupt handlers; answer: C, cycles u32 of each vector
 */
#include <errno.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "emulator.h"

static int parent = -1;
// Reset or hang that waits for the end of the instruction in which a ping begins, which sets the program counter.
static void (*postponed)(avr_t *);

void parent_start(int descriptor) { parent = descriptor; }

static void write_all(const void *bytes, size_t size)
{
    for (const char *at = bytes; size;) {
        ssize_t written = write(parent, at, size);
        if (written < 0 && (errno != EINTR || end_requested()))
            switch_off(); // the parent has ended, or a signal has requested the end
        at += written > 0 ? written : 0;
        size -= written > 0 ? (size_t)written : 0;
    }
}

static void read_all(void *bytes, size_t size)
{
    for (char *at = bytes; size;) {
        ssize_t got = read(parent, at, size);
        if (got == 0 || (got < 0 && (errno != EINTR || end_requested())))
            switch_off(); // the parent has ended, or a signal has requested the end
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

void parent_report_ready(const char *url) { send_message('U', url, (uint32_t)strlen(url)); }

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

static void read_echoes(struct echoes *echoes)
{
    echoes->count = read_count();
    if (echoes->count > ECHOES_MOST)
        die("too many echoes from the parent process");
    read_all(echoes->times, echoes->count * sizeof(double));
    echoes->rate = read_double();
    echoes->start = read_double();
    echoes->samples = read_count();
    echoes->trace = realloc(echoes->trace, echoes->samples * sizeof(float) + 1);
    if (!echoes->trace)
        die("out of memory");
    read_all(echoes->trace, echoes->samples * sizeof(float));
}

// Process one message. True if it contained echoes.
static bool process_message(avr_t *avr, struct echoes *echoes)
{
    char kind;
    read_all(&kind, 1);
    read_count();
    switch (kind) {
    case 'E':
        if (!echoes)
            die("unexpected echoes from the parent process");
        read_echoes(echoes);
        return true;
    case 'R':
        postponed = reset_board;
        return false;
    case 'H':
        postponed = hang_board;
        return false;
    case 'S':
        turntable_slip(read_double());
        return false;
    case 'W':
        turntable_wedge(avr, read_double());
        return false;
    case 'M':
        miswire(avr, read_count());
        return false;
    case 'C':
        send_message('C', longest_interrupts(), INTERRUPTS * sizeof(uint32_t));
        return false;
    default:
        die("unknown message from the parent process");
        return false;
    }
}

static void process_messages(avr_t *avr, int wait_ms)
{
    struct pollfd waiting = {.fd = parent, .events = POLLIN};
    while (poll(&waiting, 1, wait_ms) > 0)
        process_message(avr, NULL);
    if (postponed)
        postponed(avr);
    postponed = NULL;
}

// While the machine stops the client, the firmware would treat the host as gone, or return to the former baud rate. It
// sends heartbeats, so the board's time stops until the client has read them.
void parent_poll(avr_t *avr)
{
    process_messages(avr, 0);
    while (client_late(avr) && !end_requested())
        process_messages(avr, 1);
}

void parent_request_echoes(avr_t *avr, const struct ping *ping, struct echoes *echoes)
{
    if (parent < 0) {
        echoes->count = echoes->samples = 0;
        return;
    }
    char bytes[19];
    double now = seconds(avr);
    memcpy(bytes, &ping->degrees, 8);
    memcpy(bytes + 8, &now, 8);
    memcpy(bytes + 16, &ping->sweep, 2);
    bytes[18] = (char)ping->index;
    send_message('P', bytes, sizeof bytes);
    while (!process_message(avr, echoes))
        ;
}
