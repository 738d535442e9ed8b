/* The firmware as a program of Linux, and its main loop. One thread does everything. */
#include <err.h> // warn
#include <getopt.h>
#include <poll.h> // ppoll
#include <sched.h> // sched_setscheduler
#include <signal.h>
#include <stdio.h>
#include <stdlib.h> // exit
#include <sys/mman.h> // mlockall
#include <time.h> // struct timespec

#include "clock.h"
#include "conversation.h"
#include "gpio.h"
#include "hardware.h" // motor_release
#include "identity.h"
#include "messages.h" // NO_TEMPERATURE
#include "parts.h"
#include "terminal.h"

#define PASS_NS 1000000 // longest time between two passes of the main loop
#define PRIORITY 50 // above all ordinary programs, and equal to the interrupt threads of the kernel

static struct {
    const char *chip, *file, *link;
} options = {.chip = "/dev/gpiochip0", .file = "sonarhw-eeprom"};

static volatile sig_atomic_t ending;

static void end(int signal)
{
    (void)signal;
    ending = 1;
}

static void read_options(int count, char **words)
{
    static const struct option known[] = {{"gpio", required_argument, NULL, 'g'},
                                          {"eeprom", required_argument, NULL, 'e'},
                                          {"link", required_argument, NULL, 'l'},
                                          {"help", no_argument, NULL, 'h'},
                                          {NULL, 0, NULL, 0}};
    for (int option; (option = getopt_long(count, words, "", known, NULL)) != -1;) {
        switch (option) {
        case 'g':
            options.chip = optarg;
            break;
        case 'e':
            options.file = optarg;
            break;
        case 'l':
            options.link = optarg;
            break;
        default:
            fprintf(option == 'h' ? stdout : stderr,
                    "usage: %s [--gpio CHIP] [--eeprom FILE] [--link LINK]\n"
                    "  CHIP  the GPIO chip, /dev/gpiochip0 if not given\n"
                    "  FILE  keeps serial number and wiring, sonarhw-eeprom if not given\n"
                    "  LINK  a symbolic link to the pseudo-terminal, to be created\n"
                    "The first line of standard output is the URL for sonarhw.\n",
                    words[0]);
            exit(option == 'h' ? 0 : 2);
        }
    }
}

// Other programs, and memory that was moved to a disk, must not delay steps.
static void become_urgent(void)
{
    if (sched_setscheduler(0, SCHED_FIFO, &(struct sched_param){PRIORITY}) || mlockall(MCL_CURRENT | MCL_FUTURE))
        warn("no real-time priority, so other programs can delay steps; see firmware/PORTING.md");
}

static uint64_t earlier(uint64_t one, uint64_t other) { return one < other ? one : other; }

// Wait for a byte, an edge, or a time.
static void wait_until(uint64_t due)
{
    uint64_t now = clock_ns();
    if (due <= now)
        return;
    struct timespec left = {.tv_nsec = (long)earlier(due - now, PASS_NS)};
    struct pollfd sources[] = {{.fd = terminal_descriptor(), .events = POLLIN},
                               {.fd = gpio_descriptor(), .events = POLLIN}};
    ppoll(sources, 2, &left, NULL);
}

int main(int count, char **words)
{
    read_options(count, words);
    const struct sigaction ends = {.sa_handler = end};
    sigaction(SIGTERM, &ends, NULL);
    sigaction(SIGINT, &ends, NULL);
    clock_start();
    turning_start();
    ranging_start();
    gpio_start(options.chip);
    identity_start(options.file);
    conversation_reset();
    become_urgent();
    puts(terminal_start(options.link));
    fflush(stdout);
    while (!ending) {
        ranging_work();
        turning_work();
        conversation_run();
        terminal_flush();
        wait_until(earlier(ranging_due(), turning_due()));
    }
    ranging_stop();
    motor_release();
}

void interrupts_off(void) {}

void interrupts_on(void) {}

int16_t thermometer(void) { return NO_TEMPERATURE; }

uint8_t reset_cause(void) { return RESET_CAUSE_POWER; }

uint16_t stack_free(void) { return 0; }
