/* A Linux program on an emulated GPIO chip: a library that is loaded before the C library, so that it answers the
 * program's system calls (LD_PRELOAD).
 *
 *   gpio_chip.c      the chip, by the character device of Linux (uAPI v2), and the board's time
 *   system_calls.c   the system calls that it answers
 *
 * The models of the emulated board are wired to the pins of a chip of libsimavr that runs no program. Time stands still except during the system calls of the program: each takes a fixed time, and a wait
 * takes as long as the program asks. So the results do not depend on the speed of the machine.
 */
#ifndef GPIO_CHIP_H
#define GPIO_CHIP_H

#include <stdbool.h>
#include <stdint.h>

struct gpio_v2_line_event;

/* gpio_chip.c */
uint64_t board_ns(void);
void pass_time(uint64_t ns); // the models work meanwhile
bool pass_time_until_edge(uint64_t ns); // at most `ns`; whether an edge is waiting
void stall(void); // now and then, other programs delay this one, if the options say so
int request_lines(void *request); // struct gpio_v2_line_request; 0, or an error number
int line_values(int descriptor, void *values, bool set); // struct gpio_v2_line_values; the same
bool are_lines(int descriptor); // a descriptor of a request
bool take_edge(struct gpio_v2_line_event *event); // false if none is waiting
void set_terminal(int descriptor); // of the pseudo-terminal to the host
bool sends_too_early(int descriptor); // whether this is the terminal, and the board listens
void program_waits(bool heard); // call it in each wait; `heard`: the host has sent bytes, or is not connected

#endif
