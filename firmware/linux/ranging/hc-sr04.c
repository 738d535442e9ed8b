/* An HC-SR04: a pulse on TRIGGER transmits. ECHO is high for the time of flight. The kernel times both edges. */
#include "board_facts.h" // LISTEN_MOST_US
#include "clock.h"
#include "gpio.h"
#include "hardware.h" // ping_start
#include "messages.h" // enum input
#include "parts.h" // ranging_start
#include "pins.h"

#define TRIGGER_NS 12000 // at least 10 us
#define RISES_WITHIN_NS 5000000 // otherwise no module is connected
#define FALLS_WITHIN_NS 60000000 // without an echo, ECHO is high for 38 ms

enum phase { WAITING, TRIGGERED, MEASURING, MEASURED };

static enum phase phase;
static uint64_t triggered_ns, risen_ns;
static uint32_t flight; // ticks

void ranging_start(void)
{
    gpio_output(TRIGGER, false);
    gpio_input(ECHO, GPIO_EDGES);
}

void ranging_work(void)
{
    for (struct gpio_edge edge; gpio_next_edge(&edge);) {
        if (phase == TRIGGERED && edge.rising) {
            risen_ns = edge.ns;
            phase = MEASURING;
        } else if (phase == MEASURING && !edge.rising) {
            flight = (uint32_t)((edge.ns - risen_ns) / NS_A_TICK);
            phase = MEASURED;
        }
    }
}

uint64_t ranging_due(void) { return NEVER; }

void ping_start(const struct ping_order *order)
{
    (void)order; // the module always listens until the first echo, and the core drops what is not wanted
    phase = WAITING;
    ranging_work(); // edges from before this ping
    phase = TRIGGERED;
    risen_ns = triggered_ns = clock_ns();
    gpio_write(TRIGGER, true);
    gpio_hold(clock_ns(), TRIGGER_NS);
    gpio_write(TRIGGER, false);
}

bool ping_over(void)
{
    uint64_t since = clock_ns() - triggered_ns;
    return phase == MEASURED || since >= (phase == TRIGGERED ? RISES_WITHIN_NS : FALLS_WITHIN_NS);
}

struct ping_result ping_result(void)
{
    // the module transmits shortly before it raises ECHO, and takes this time for the start
    return (struct ping_result){
        .fired_us = risen_ns / 1000,
        .echoes = &flight,
        .echo_count = phase == MEASURED && flight < 2 * LISTEN_MOST_US,
    };
}

uint8_t ranging_inputs(void) { return gpio_read(ECHO) ? INPUT_ECHO : 0; }

void ranging_stop(void) { gpio_write(TRIGGER, false); }
