/* The system calls that the emulated GPIO chip answers. All others, and all other files, belong to the kernel. */
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>

#include <linux/gpio.h>

#include "../emulator.h"
#include "gpio_chip.h"

#define GPIO_CHIP "/dev/gpiochip0"
// the time that a system call takes
#define CLOCK_NS 250
#define READ_NS 1000
#define VALUES_NS 2000
#define WAIT_NS 5000

static int gpio_chip = -1; // descriptor

// The function of the C library.
#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static int result(int error)
{
    errno = error;
    return error ? -1 : 0;
}

int open(const char *path, int how, ...)
{
    va_list rest;
    va_start(rest, how);
    mode_t mode = va_arg(rest, mode_t);
    va_end(rest);
    if (strcmp(path, GPIO_CHIP))
        return REAL(open)(path, how, mode);
    gpio_chip = REAL(open)("/dev/null", how);
    return gpio_chip;
}

int ioctl(int descriptor, unsigned long request, ...)
{
    va_list rest;
    va_start(rest, request);
    void *argument = va_arg(rest, void *);
    va_end(rest);
    if (request == GPIO_V2_GET_LINE_IOCTL && descriptor == gpio_chip)
        return result(request_lines(argument));
    if (!are_lines(descriptor))
        return REAL(ioctl)(descriptor, request, argument);
    if (request != GPIO_V2_LINE_SET_VALUES_IOCTL && request != GPIO_V2_LINE_GET_VALUES_IOCTL)
        return result(ENOTTY);
    pass_time(VALUES_NS / 2);
    bool set = request == GPIO_V2_LINE_SET_VALUES_IOCTL;
    int error = line_values(descriptor, argument, set);
    pass_time(VALUES_NS / 2);
    if (set)
        stall();
    return result(error);
}

ssize_t read(int descriptor, void *bytes, size_t size)
{
    if (!are_lines(descriptor))
        return REAL(read)(descriptor, bytes, size);
    pass_time(READ_NS);
    if (size < sizeof(struct gpio_v2_line_event))
        return result(EINVAL);
    return take_edge(bytes) ? (ssize_t)sizeof(struct gpio_v2_line_event) : result(EAGAIN);
}

ssize_t write(int descriptor, const void *bytes, size_t size)
{
    if (sends_too_early(descriptor))
        die("the firmware sends while it listens");
    return REAL(write)(descriptor, bytes, size);
}

int clock_gettime(clockid_t clock, struct timespec *time)
{
    if (clock != CLOCK_MONOTONIC)
        return REAL(clock_gettime)(clock, time);
    pass_time(CLOCK_NS);
    *time = (struct timespec){(time_t)(board_ns() / 1000000000), (long)(board_ns() % 1000000000)};
    return 0;
}

int posix_openpt(int how)
{
    int terminal = REAL(posix_openpt)(how);
    set_terminal(terminal);
    return terminal;
}

// Bytes of the host come in real time: look for them, then let time pass until an edge or the end of the wait.
int ppoll(struct pollfd *files, nfds_t count, const struct timespec *timeout, const sigset_t *signals)
{
    static const struct timespec at_once;
    struct pollfd *lines = NULL;
    bool connected = false; // the program waits for bytes only while a host is connected
    for (nfds_t at = 0; at < count; at++) {
        if (are_lines(files[at].fd))
            lines = &files[at];
        else
            connected |= files[at].fd >= 0;
    }
    int descriptor = lines ? lines->fd : -1;
    if (lines)
        lines->fd = -1; // the kernel ignores it
    int found = REAL(ppoll)(files, count, &at_once, signals);
    pass_time(WAIT_NS);
    uint64_t ns = found ? 0 : (uint64_t)timeout->tv_sec * 1000000000 + (uint64_t)timeout->tv_nsec;
    bool edge = pass_time_until_edge(ns);
    stall();
    program_waits(!connected || found > 0);
    if (!lines)
        return found;
    lines->fd = descriptor;
    lines->revents = edge ? POLLIN : 0;
    return found + edge;
}

// Tests must not get real-time priority on the machine on which they run.
int sched_setscheduler(pid_t process, int policy, const struct sched_param *parameters)
{
    (void)process;
    (void)policy;
    (void)parameters;
    return 0;
}
