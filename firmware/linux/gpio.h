/* Lines of a GPIO chip, by the character device of Linux 5.10 or newer. */
#ifndef GPIO_H
#define GPIO_H

#include <stdbool.h>
#include <stdint.h>

enum gpio_input {
    GPIO_EDGES, // without a pull-up; both edges are reported
    GPIO_PULL_UP,
};

struct gpio_edge {
    uint64_t ns; // of clock.h; the kernel takes it in the interrupt
    bool rising;
};

// Name the lines first. `gpio_start` then takes them all at once, or ends the program with an error.
void gpio_output(uint8_t line, bool high);
void gpio_input(uint8_t line, enum gpio_input kind);
void gpio_start(const char *chip);

int gpio_descriptor(void); // readable while an edge is waiting
bool gpio_next_edge(struct gpio_edge *edge); // the oldest that is waiting; false if there is none
bool gpio_read(uint8_t line);
void gpio_write(uint8_t line, bool high);
void gpio_hold(uint64_t since_ns, uint32_t ns); // wait until this long after `since_ns`: for short pulses only

#endif
