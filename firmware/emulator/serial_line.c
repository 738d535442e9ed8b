/* The serial line on a pseudo-terminal, with the duration of real bytes. Bytes are garbled if the baud rates differ. */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <asm/termbits.h>
#include <simavr/avr_uart.h>

#include "emulator.h"

#define UCSR0A 0xC0
#define UBRR0L 0xC4
#define UBRR0H 0xC5
#define DOUBLE_SPEED 0x02
#define UNSET_BAUD 38400 // of a new pseudo-terminal; a client that never sets it gets undamaged bytes
#define NOISE_EVERY 3000 // bytes
#define STALLED 10000 // ms; the emulator waits this long for a client that does not read, then discards bytes

static struct {
    int terminal;
    char name[64];
    const char *link;
    bool any_baud;
    avr_irq_t *uart;
    uint8_t sending[4096];
    size_t send_size;
    uint8_t received[4096];
    size_t received_at, received_size;
    bool feeding;
    avr_cycle_count_t last_byte; // time of the last byte from a client, or without a client
    uint32_t noise;
} line;

static unsigned firmware_baud(const avr_t *avr)
{
    unsigned divisor = avr->data[UBRR0L] | avr->data[UBRR0H] << 8;
    return FREQUENCY / (avr->data[UCSR0A] & DOUBLE_SPEED ? 8 : 16) / (divisor + 1);
}

static avr_cycle_count_t byte_cycles(const avr_t *avr) { return 10 * FREQUENCY / firmware_baud(avr); }

// Correct simavr, which adds a parity bit that is not sent.
static void correct_pace(avr_t *avr)
{
    for (avr_io_t *io = avr->io_port; io; io = io->next)
        if (!strcmp(io->kind, "uart") && ((avr_uart_t *)io)->name == '0')
            ((avr_uart_t *)io)->cycles_per_byte = byte_cycles(avr);
}

static unsigned host_baud(void)
{
    struct termios2 settings;
    return ioctl(line.terminal, TCGETS2, &settings) ? 0 : settings.c_ospeed;
}

// A byte as it is received at a wrong baud rate.
static uint8_t garbled(uint8_t byte)
{
    line.noise = line.noise * 1664525 + 1013904223;
    return byte ^ (uint8_t)(line.noise >> 24) ^ 0x55;
}

// Whether a byte is damaged on a noisy line.
static bool damaged_by_noise(void)
{
    static unsigned count;
    return miswired(LINE_NOISY) && ++count % NOISE_EVERY == 0;
}

static bool baud_rates_differ(const avr_t *avr)
{
    unsigned baud = host_baud();
    return !line.any_baud && baud != UNSET_BAUD && baud != firmware_baud(avr);
}

static bool client_connected(void)
{
    struct pollfd terminal = {.fd = line.terminal};
    return poll(&terminal, 1, 0) <= 0 || !(terminal.revents & POLLHUP);
}

static void flush(void)
{
    size_t at = 0;
    while (at < line.send_size && client_connected()) {
        ssize_t written = write(line.terminal, line.sending + at, line.send_size - at);
        struct pollfd room = {.fd = line.terminal, .events = POLLOUT};
        if (written > 0)
            at += (size_t)written;
        else if (errno != EAGAIN || poll(&room, 1, STALLED) <= 0)
            break;
    }
    line.send_size = 0;
}

static void sent(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
    (void)irq;
    avr_t *avr = parameter;
    if (ranging_listens())
        die("the firmware sends while it listens");
    if (line.send_size == 0 || line.send_size == sizeof line.sending)
        flush();
    bool wrong = baud_rates_differ(avr) || damaged_by_noise();
    line.sending[line.send_size++] = wrong ? garbled((uint8_t)value) : (uint8_t)value;
}

static avr_cycle_count_t feed(avr_t *avr, avr_cycle_count_t when, void *unused)
{
    (void)unused;
    if (line.received_at == line.received_size) {
        line.feeding = false;
        return 0;
    }
    uint8_t byte = line.received[line.received_at++];
    avr_raise_irq(line.uart + UART_IRQ_INPUT, baud_rates_differ(avr) ? garbled(byte) : byte);
    return when + byte_cycles(avr);
}

void line_reset(void)
{
    line.received_at = line.received_size = 0;
    line.feeding = false;
}

double line_silence(const avr_t *avr)
{
    return avr->cycle > line.last_byte ? (double)(avr->cycle - line.last_byte) / FREQUENCY : 0;
}

void line_poll(avr_t *avr)
{
    correct_pace(avr);
    flush();
    if (line.feeding || !client_connected())
        line.last_byte = avr->cycle;
    if (line.received_at < line.received_size)
        return;
    ssize_t got = read(line.terminal, line.received, sizeof line.received);
    if (got <= 0)
        return;
    line.received_at = 0;
    line.received_size = (size_t)got;
    line.last_byte = avr->cycle; // a short frame at a high baud rate ends before the next poll
    if (!line.feeding) {
        line.feeding = true;
        avr_cycle_timer_register(avr, byte_cycles(avr), feed, NULL);
    }
}

static void make_raw(int descriptor)
{
    struct termios2 settings;
    if (ioctl(descriptor, TCGETS2, &settings))
        die("cannot read the settings of the pseudo-terminal");
    settings.c_iflag = settings.c_oflag = settings.c_lflag = 0;
    settings.c_cflag = CS8 | CREAD | CLOCAL | B38400;
    ioctl(descriptor, TCSETS2, &settings);
}

void line_start(avr_t *avr, const char *link, bool any_baud)
{
    line.terminal = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (line.terminal < 0 || grantpt(line.terminal) || unlockpt(line.terminal) ||
        ptsname_r(line.terminal, line.name, sizeof line.name))
        die("cannot create a pseudo-terminal");
    // open and close it once; from then on it reports whether a client is connected
    int once = open(line.name, O_RDWR | O_NOCTTY);
    if (once < 0)
        die("cannot open the pseudo-terminal");
    make_raw(once);
    close(once);
    if (link && symlink(line.name, link))
        die("cannot create the link to the pseudo-terminal; does it exist already?");
    line.link = link; // line_end removes it, so only one that was made here
    line.any_baud = any_baud;
    line.uart = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), 0);
    uint32_t flags = 0;
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_register_notify(line.uart + UART_IRQ_OUTPUT, sent, avr);
}

int line_terminal(void) { return line.terminal; }

void line_end(void)
{
    if (line.link)
        unlink(line.link);
}

const char *line_name(void) { return line.link ? line.link : line.name; }
