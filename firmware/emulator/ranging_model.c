/* Model of the 6500 or of an HC-SR04, and of the envelope and the thermistor at the converter.
 *
 * 6500: an echo sets ECHO until INIT falls or BLNK rises. Echoes during the blanking (2.38 ms, or until BINH rises) or
 * while BLNK is high are ignored. As on a real 6500, noise of the transmitter sets ECHO for a short time.
 * HC-SR04: ECHO is high from the end of the burst until the first echo.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <simavr/avr_adc.h>
#include <simavr/sim_io.h>
#include <simavr/sim_time.h>

#include "emulator.h"

#define BLANKING 0.00238 // s
#define NOISE 0.0001 // s after INIT
#define FALSE_ECHO 0.003 // s after INIT, with noise on INIT
#define NOISE_LASTS 160 // cycles
#define TRIGGER 160 // cycles, shortest pulse at TRIGGER of an HC-SR04
#define BURST 0.00045 // s from this pulse until an HC-SR04 has transmitted and raises ECHO
#define SILENT 0.038 // s; then it lowers ECHO without an echo
#define SUPPLY 5000 // mV
#define CONVERSION 208 // cycles of a conversion while tracing
#define HOLD_CYCLES 24 // from the start of a conversion to sample-and-hold
#define THERMISTOR_CHANNEL 1

static struct {
    bool transmitting, blanked, inhibited, latched;
    avr_cycle_count_t fired;
    avr_cycle_count_t triggered; // rising edge of TRIGGER
    struct echoes echoes;
    unsigned next; // index of the next echo
    double temperature;
    avr_irq_t *converter;
    unsigned pending; // mV of the previous conversion
    unsigned conversions; // of this trace
    bool converting; // a conversion has begun, and its end is not corrected yet
    avr_cycle_count_t due; // end of the last conversion
} board;

void ranging_show(avr_t *avr) { set_pin(avr, options.controller->echo, (board.latched && !miswired(ECHO_LOW)) || miswired(ECHO_HIGH)); }

static void set_echo(avr_t *avr, bool high)
{
    board.latched = high;
    ranging_show(avr);
}

static avr_cycle_count_t cycles_of(double time) { return board.fired + (avr_cycle_count_t)llround(time * FREQUENCY); }

static avr_cycle_count_t echo_arrives(avr_t *avr, avr_cycle_count_t when, void *unused)
{
    (void)unused;
    bool open = board.inhibited || when >= cycles_of(BLANKING);
    if (!board.latched && !board.blanked && open)
        set_echo(avr, true);
    if (++board.next == board.echoes.count)
        return 0;
    avr_cycle_count_t next = cycles_of(board.echoes.times[board.next]);
    return next > when ? next : when + 1;
}

static avr_cycle_count_t noise(avr_t *avr, avr_cycle_count_t when, void *unused)
{
    (void)unused;
    set_echo(avr, !board.latched);
    return board.latched ? when + NOISE_LASTS : 0;
}

static void request_echoes(avr_t *avr)
{
    struct ping ping = current_ping(avr);
    ping.degrees = turntable_degrees();
    parent_request_echoes(avr, &ping, &board.echoes);
}

static avr_cycle_count_t false_echo(avr_t *avr, avr_cycle_count_t when, void *unused)
{
    (void)when;
    (void)unused;
    if (!board.latched && !board.blanked)
        set_echo(avr, true);
    return 0;
}

static void init_changed(avr_t *avr, bool high)
{
    if (miswired(INIT_OPEN))
        return;
    board.transmitting = high;
    avr_cycle_timer_cancel(avr, echo_arrives, NULL);
    avr_cycle_timer_cancel(avr, noise, NULL);
    avr_cycle_timer_cancel(avr, false_echo, NULL);
    set_echo(avr, false);
    if (!high)
        return;
    board.fired = avr->cycle;
    board.next = 0;
    board.conversions = 0;
    request_echoes(avr);
    avr_cycle_timer_register(avr, (avr_cycle_count_t)(NOISE * FREQUENCY), noise, NULL);
    if (miswired(NOISE_ON_INIT))
        avr_cycle_timer_register(avr, (avr_cycle_count_t)(FALSE_ECHO * FREQUENCY), false_echo, NULL);
    if (board.echoes.count) {
        avr_cycle_count_t first = cycles_of(board.echoes.times[0]);
        avr_cycle_timer_register(avr, first > avr->cycle ? first - avr->cycle : 1, echo_arrives, NULL);
    }
}

static void blnk_changed(avr_t *avr, bool high)
{
    board.blanked = high && !miswired(BLNK_OPEN);
    if (board.blanked)
        set_echo(avr, false);
}

static void binh_changed(avr_t *avr, bool high)
{
    (void)avr;
    board.inhibited = high;
}

static avr_cycle_count_t hc_sr04_falls(avr_t *avr, avr_cycle_count_t when, void *unused)
{
    (void)when;
    (void)unused;
    board.transmitting = false;
    set_echo(avr, false);
    return 0;
}

static avr_cycle_count_t hc_sr04_rises(avr_t *avr, avr_cycle_count_t when, void *unused)
{
    (void)unused;
    board.fired = when;
    set_echo(avr, true);
    double flight = board.echoes.count && board.echoes.times[0] < SILENT ? board.echoes.times[0] : SILENT;
    avr_cycle_timer_register(avr, (avr_cycle_count_t)llround(flight * FREQUENCY), hc_sr04_falls, NULL);
    return 0;
}

static void trigger_changed(avr_t *avr, bool high)
{
    if (high)
        board.triggered = avr->cycle;
    else if (avr->cycle - board.triggered < TRIGGER)
        die("the pulse at TRIGGER is shorter than 10 us");
    if (high || board.transmitting || miswired(INIT_OPEN))
        return;
    board.transmitting = true;
    request_echoes(avr);
    avr_cycle_timer_register(avr, (avr_cycle_count_t)(BURST * FREQUENCY), hc_sr04_rises, NULL);
}

// The envelope at a number of cycles after INIT, interpolated between two samples of the source.
static double envelope(avr_cycle_count_t cycles)
{
    if (!board.transmitting || !board.echoes.samples)
        return 0;
    double at = ((double)cycles / FREQUENCY - board.echoes.start) * board.echoes.rate;
    if (at < 0 || at >= board.echoes.samples - 1)
        return 0;
    unsigned before = (unsigned)at;
    double share = at - before;
    return (1 - share) * board.echoes.trace[before] + share * board.echoes.trace[before + 1];
}

// A thermistor of 10 kOhm at 25 °C towards ground, 10 kOhm towards the supply.
static double thermistor(void)
{
    if (miswired(THERMISTOR_SHORTED))
        return 0;
    if (isnan(board.temperature) || miswired(THERMISTOR_OPEN))
        return 1;
    double ratio = exp(3950 * (1 / (board.temperature + 273.15) - 1 / 298.15));
    return ratio / (1 + ratio);
}

static avr_io_t *adc_of(avr_t *avr)
{
    avr_io_t *module = avr->io_port;
    while (module && strcmp(module->kind, "adc"))
        module = module->next;
    return module;
}

// A conversion begins. In free-running mode simavr starts the next conversion before the firmware reads the last one.
// So this sets the pending value of the last one.
static void conversion(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
    (void)irq;
    avr_t *avr = parameter;
    union {
        avr_adc_mux_t mux;
        uint32_t value;
    } channel = {.value = value};
    if (channel.mux.src == THERMISTOR_CHANNEL) {
        board.conversions = 0;
        avr_raise_irq(board.converter + ADC_IRQ_ADC1, (uint32_t)lround(thermistor() * SUPPLY));
        return;
    }
    double level = envelope(avr->cycle + HOLD_CYCLES - board.fired);
    // plus half a count, so that rounding down by the converter gives the nearest of 256 levels
    unsigned now = (unsigned)lround((floor(level * 255 + 0.5) + 0.5) / 256 * SUPPLY);
    avr_raise_irq(board.converter + ADC_IRQ_ADC0, board.conversions++ ? board.pending : now);
    board.pending = now;
    board.converting = true;
}

// simavr begins a conversion only after the instruction in which the last one ended. The converter of a chip runs on its
// own clock, so its conversions end every CONVERSION cycles.
void ranging_time_conversion(avr_t *avr)
{
    if (!board.converting)
        return;
    board.converting = false;
    avr_cycle_timer_slot_p slot = avr->cycle_timers.timer;
    while (slot && (!slot->param || slot->param != adc_of(avr)))
        slot = slot->next;
    if (!slot)
        return;
    if (board.conversions == 1) {
        board.due = slot->when;
        return;
    }
    board.due += CONVERSION;
    avr_cycle_timer_t end = slot->timer;
    avr_cycle_timer_cancel(avr, end, adc_of(avr));
    avr_cycle_timer_register(avr, board.due > avr->cycle ? board.due - avr->cycle : 1, end, adc_of(avr));
}

void ranging_reset(avr_t *avr)
{
    if (options.ranging == HC_SR04)
        return; // the module does not notice the reset of the chip
    board.transmitting = board.blanked = board.inhibited = false;
    set_echo(avr, false);
}

bool ranging_listens(void) { return board.transmitting; }

void ranging_start(avr_t *avr, double temperature)
{
    board.temperature = temperature;
    board.converter = avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, 0);
    avr_irq_register_notify(board.converter + ADC_IRQ_OUT_TRIGGER, conversion, avr);
    ranging_show(avr);
    if (options.ranging == HC_SR04) {
        listen_to_pin(avr, options.controller->init, trigger_changed);
        return;
    }
    listen_to_pin(avr, options.controller->init, init_changed);
    listen_to_pin(avr, options.controller->blnk, blnk_changed);
    listen_to_pin(avr, options.controller->binh, binh_changed);
}
