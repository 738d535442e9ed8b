/* Runs the board in real time, faster by a factor, or as fast as possible, but not ahead of a client that is late. */
#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>

#include "emulator.h"

#define LATE (FREQUENCY / 10) // cycles in which a client reads everything, unless the machine stops it
#define MOST_BEHIND 0.1 // s; a longer delay of the machine is not caught up
// s of board time without a byte from the host. The firmware gives up after 2 s. A host that sends every 0.5 s of real
// time is silent for up to 0.3 s more at the pace below. If it is stopped then, 0.35 s later the board waits for it.
#define HOST_LATE 1.3
#define PATIENT 0.5 // pace while the host is late

// not CLOCK_MONOTONIC, which is the time of the board in a program on an emulated GPIO chip
static double real_seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC_RAW, &now);
    return (double)now.tv_sec + now.tv_nsec * 1e-9;
}

// Whether the client has disconnected, or has written bytes that are waiting for the board.
static bool client_gone_or_writing(void)
{
    struct pollfd terminal = {.fd = line_terminal(), .events = POLLIN};
    return poll(&terminal, 1, 0) > 0;
}

static int unread_bytes(void)
{
    int client = open(ptsname(line_terminal()), O_RDONLY | O_NOCTTY), count = 0;
    if (client < 0)
        return 0; // locked by the client
    ioctl(client, FIONREAD, &count);
    close(client);
    return count;
}

bool client_late(const avr_t *avr)
{
    static avr_cycle_count_t checked;
    if (avr->cycle - checked < LATE)
        return false;
    if (!client_gone_or_writing() && unread_bytes())
        return true;
    checked = avr->cycle;
    return false;
}

// Slow down while the host is late: at a fast pace the firmware would treat a slow host as gone.
static double pace(const avr_t *avr)
{
    bool fast = options.pace == 0 || options.pace > PATIENT;
    return fast && line_silence(avr) > HOST_LATE ? PATIENT : options.pace;
}

void keep_pace(const avr_t *avr)
{
    static double before, due; // the board's time at the last call, and the real time that corresponds to it
    double now = pace(avr);
    if (now > 0)
        due += (seconds(avr) - before) / now;
    before = seconds(avr);
    double ahead = due - real_seconds();
    if (ahead < -MOST_BEHIND || ahead > 1)
        due = real_seconds();
    else if (ahead > 0)
        usleep((useconds_t)(ahead * 1e6));
}
