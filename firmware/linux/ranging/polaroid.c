/* The 6500 ranging board: outputs INIT, BLNK and BINH; the kernel times the edges of ECHO.
 *
 * The start of a ping is the time at which INIT is set. If the program is interrupted just then, this time is unknown:
 * the echoes are dropped, and the ping is repeated.
 */
#include "board_facts.h" // BLANKING_US
#include "clock.h"
#include "gpio.h"
#include "hardware.h" // ping_start
#include "messages.h" // enum input
#include "parts.h" // ranging_start
#include "pins.h"

#define FIRES_WITHIN_NS 20000 // otherwise the start is not known well enough: 10 us are 1.7 mm

static struct ping_order order;
static uint64_t fired_ns;
static bool fired_in_time;
static uint32_t echoes[ECHOES_MOST]; // ticks
static uint8_t echo_count;
static uint64_t wakes_ns; // end of blanking or of re-arming
static bool unblanks; // it is the end of blanking

void ranging_start(void)
{
    gpio_output(INIT, false);
    gpio_output(BLNK, false);
    gpio_output(BINH, false);
    gpio_input(ECHO, GPIO_EDGES);
    wakes_ns = NEVER;
}

uint64_t ranging_due(void) { return wakes_ns; }

static void take_echo(uint64_t ns)
{
    uint64_t since_ns = ns - fired_ns;
    // earlier edges are noise of the transmitter
    if (ns < fired_ns + BLANKING_LEAST_US * 1000 || echo_count == order.echoes)
        return;
    echoes[echo_count++] = (uint32_t)(since_ns / NS_A_TICK);
    if (echo_count < order.echoes) {
        gpio_write(BLNK, true);
        wakes_ns = clock_ns() + order.rearm_us * 1000ULL;
    }
}

static void end_wait(void)
{
    if (unblanks)
        gpio_write(BINH, true);
    unblanks = false;
    gpio_write(BLNK, false);
    wakes_ns = NEVER;
}

void ranging_work(void)
{
    for (struct gpio_edge edge; gpio_next_edge(&edge);)
        if (edge.rising)
            take_echo(edge.ns);
    if (clock_ns() >= wakes_ns)
        end_wait();
}

static void fire(void)
{
    echo_count = order.echoes; // drop edges from before this ping
    ranging_work();
    unblanks = order.blanking_us != BLANKING_US;
    gpio_write(BLNK, order.blanking_us > BLANKING_US);
    uint64_t before = clock_ns();
    gpio_write(INIT, true);
    uint64_t after = clock_ns();
    fired_in_time = after - before <= FIRES_WITHIN_NS;
    fired_ns = before + (after - before) / 2;
    wakes_ns = unblanks ? fired_ns + order.blanking_us * 1000ULL : NEVER;
    echo_count = 0;
}

void ranging_stop(void)
{
    gpio_write(INIT, false);
    gpio_write(BLNK, false);
    gpio_write(BINH, false);
    wakes_ns = NEVER;
}

void ping_start(const struct ping_order *wanted)
{
    order = *wanted;
    fire();
}

bool ping_over(void)
{
    uint64_t since_us = (clock_ns() - fired_ns) / 1000;
    if (since_us < order.listen_us)
        return false;
    ranging_work();
    ranging_stop();
    if (fired_in_time)
        return true;
    if (since_us >= PING_PERIOD_US)
        fire();
    return false;
}

struct ping_result ping_result(void)
{
    return (struct ping_result){.fired_us = fired_ns / 1000, .echoes = echoes, .echo_count = echo_count};
}

uint8_t ranging_inputs(void) { return gpio_read(ECHO) ? INPUT_ECHO : 0; }
