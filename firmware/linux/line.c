#include "line.h"

#include <err.h> // err
#include <errno.h>
#include <fcntl.h> // O_RDWR
#include <poll.h>
#include <stdlib.h> // posix_openpt
#include <string.h> // memcpy
#include <sys/stat.h> // lstat
#include <termios.h>
#include <unistd.h> // read

#include "board_facts.h" // FASTEST_BAUD
#include "terminal.h"

static struct {
    int descriptor;
    char name[64];
    const char *link;
    uint8_t sending[4096];
    size_t send_size;
    uint8_t received[4096];
    size_t received_at, received_size;
} terminal;

static bool host_connected(void)
{
    struct pollfd hung = {.fd = terminal.descriptor};
    return poll(&hung, 1, 0) <= 0 || !(hung.revents & POLLHUP);
}

static void remove_link(void) { unlink(terminal.link); }

// A program that was killed leaves its link.
static void make_link(const char *link)
{
    struct stat old;
    if (!lstat(link, &old) && S_ISLNK(old.st_mode))
        unlink(link);
    if (symlink(terminal.name, link))
        err(1, "%s: cannot create the link to the pseudo-terminal", link);
    terminal.link = link;
    atexit(remove_link);
}

const char *terminal_start(const char *link)
{
    terminal.descriptor = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (terminal.descriptor < 0 || grantpt(terminal.descriptor) || unlockpt(terminal.descriptor) ||
        ptsname_r(terminal.descriptor, terminal.name, sizeof terminal.name))
        err(1, "cannot create a pseudo-terminal");
    // open and close it once; from then on it reports whether a host is connected
    int once = open(terminal.name, O_RDWR | O_NOCTTY);
    struct termios settings;
    if (once < 0 || tcgetattr(once, &settings))
        err(1, "%s: cannot open the pseudo-terminal", terminal.name);
    cfmakeraw(&settings);
    tcsetattr(once, TCSANOW, &settings);
    close(once);
    if (link)
        make_link(link);
    return link ? link : terminal.name;
}

int terminal_descriptor(void) { return host_connected() ? terminal.descriptor : -1; }

// Like a serial line, it does not wait for a host that does not read: bytes beyond the kernel's buffer are lost.
void terminal_flush(void)
{
    if (!terminal.send_size)
        return;
    if (host_connected() && write(terminal.descriptor, terminal.sending, terminal.send_size) < 0 && errno != EAGAIN)
        warn("cannot send");
    terminal.send_size = 0;
}

uint8_t line_write(const uint8_t *bytes, uint8_t count)
{
    if (terminal.send_size + count > sizeof terminal.sending)
        terminal_flush();
    memcpy(terminal.sending + terminal.send_size, bytes, count);
    terminal.send_size += count;
    return count;
}

bool line_quiet(void) { return !terminal.send_size; }

int16_t line_read(void)
{
    if (terminal.received_at == terminal.received_size) {
        ssize_t size = read(terminal.descriptor, terminal.received, sizeof terminal.received);
        terminal.received_at = 0;
        terminal.received_size = size > 0 ? (size_t)size : 0;
    }
    return terminal.received_size ? terminal.received[terminal.received_at++] : -1;
}

// A pseudo-terminal needs no rate, but a host may change it.
bool line_can(uint32_t baud) { return baud == 250000 || baud == 500000 || baud == FASTEST_BAUD; }

void line_set_baud(uint32_t baud) { (void)baud; }

uint32_t line_overruns(void) { return 0; }
