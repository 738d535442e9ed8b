/* Runs the board in real time, faster by a factor, or as fast as possible. */
#include <time.h>
#include <unistd.h>

#include "emulator.h"

#define MOST_BEHIND 0.1 // s; a longer delay of the machine is not caught up
#define HOST_LATE 1.6 // s of board time without a byte from the host; the firmware gives up after 2 s
#define PATIENT 0.5 // pace while the host is late

// not CLOCK_MONOTONIC, which is the time of the board in a program on an emulated GPIO chip
double real_seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC_RAW, &now);
    return (double)now.tv_sec + now.tv_nsec * 1e-9;
}

// Slow down while the host is late: at a fast pace the firmware would treat a slow host as gone.
static double pace(const avr_t *avr)
{
    return options.pace > PATIENT && line_silence(avr) > HOST_LATE ? PATIENT : options.pace;
}

void keep_pace(const avr_t *avr)
{
    static double before, due; // the board's time at the last call, and the real time that corresponds to it
    if (options.pace == 0)
        return;
    due += (seconds(avr) - before) / pace(avr);
    before = seconds(avr);
    double ahead = due - real_seconds();
    if (ahead < -MOST_BEHIND || ahead > 1)
        due = real_seconds();
    else if (ahead > 0)
        usleep((useconds_t)(ahead * 1e6));
}
