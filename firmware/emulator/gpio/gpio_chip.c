#include "gpio_chip.h"

#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <linux/gpio.h>
#include <simavr/avr_ioport.h>

#include "../emulator.h"

#define LINES 28 // of a Raspberry Pi
#define EDGES 64 // that the kernel keeps for the program
#define NS_A_CYCLE 62.5
#define SLICE (FREQUENCY / 1000) // cycles between two polls of the parent process
#define STALL_EVERY 50 // waits and changes of an output, on average, between two stalls

static avr_t *chip;

static struct {
    struct gpio_v2_line_request request;
    avr_irq_t *pins[GPIO_V2_LINES_MAX]; // by index in the request
    struct gpio_v2_line_event waiting[EDGES];
    unsigned edge_in, edge_out;
    uint32_t sequence;
    int terminal;
    bool ready; // reported to the parent
    avr_cycle_count_t last_byte, last_slice;
    uint64_t noise;
} gpio = {.terminal = -1, .noise = 1};

/* The rest of the emulated board. */

void die(const char *why)
{
    fprintf(stderr, "emulated board: %s\n", why);
    exit(1);
}

bool end_requested(void) { return false; } // the parent closes its socket

void switch_off(void) { exit(0); }

double seconds(const avr_t *avr) { return (double)avr->cycle / FREQUENCY; }

int line_terminal(void) { return gpio.terminal; }

double line_silence(const avr_t *avr) { return seconds(avr) - (double)gpio.last_byte / FREQUENCY; }

void reset_board(avr_t *avr)
{
    (void)avr;
    die("a Linux program has no reset button");
}

void hang_board(avr_t *avr)
{
    (void)avr;
    die("a Linux program has no watchdog");
}

const uint32_t *longest_interrupts(void)
{
    static const uint32_t none[INTERRUPTS];
    return none;
}

struct ping current_ping(const avr_t *avr)
{
    (void)avr;
    // struct place of core/scan/scan.h begins with sweep u16 and ping u8
    const uint8_t *place = dlsym(RTLD_DEFAULT, "ping_place");
    if (!place)
        die("the program does not export ping_place");
    struct ping ping = {.index = place[2]};
    memcpy(&ping.sweep, place, 2);
    return ping;
}

/* Time. */

uint64_t board_ns(void) { return (uint64_t)((double)chip->cycle * NS_A_CYCLE); }

static avr_cycle_count_t after(uint64_t ns) { return chip->cycle + (avr_cycle_count_t)((double)ns / NS_A_CYCLE + 0.5); }

static bool edge_waits(void) { return gpio.edge_in != gpio.edge_out; }

static void advance(avr_cycle_count_t end, bool to_edge)
{
    avr_cycle_timer_pool_t *timers = &chip->cycle_timers;
    while (timers->timer && timers->timer->when <= end && !(to_edge && edge_waits())) {
        if (timers->timer->when > chip->cycle)
            chip->cycle = timers->timer->when;
        avr_cycle_timer_process(chip);
    }
    if (chip->cycle < end && !(to_edge && edge_waits()))
        chip->cycle = end;
}

static unsigned random_below(unsigned limit)
{
    gpio.noise = gpio.noise * 6364136223846793005ULL + 1442695040888963407ULL;
    return (unsigned)((gpio.noise >> 33) % limit);
}

void pass_time(uint64_t ns) { advance(after(ns), false); }

bool pass_time_until_edge(uint64_t ns)
{
    advance(after(ns), true);
    return edge_waits();
}

void stall(void)
{
    if (options.stall > 0 && !random_below(STALL_EVERY))
        pass_time((uint64_t)(options.stall * 1e6 * random_below(1000)));
}

/* Lines. */

static void edge_came(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
    (void)irq;
    unsigned index = (unsigned)(uintptr_t)parameter;
    if (gpio.edge_in - gpio.edge_out == EDGES)
        return; // lost, as in the kernel
    gpio.waiting[gpio.edge_in++ % EDGES] = (struct gpio_v2_line_event){
        .timestamp_ns = board_ns(),
        .id = value ? GPIO_V2_LINE_EVENT_RISING_EDGE : GPIO_V2_LINE_EVENT_FALLING_EDGE,
        .offset = gpio.request.offsets[index],
        .seqno = ++gpio.sequence,
        .line_seqno = gpio.sequence,
    };
}

// The attribute of a line, as in the kernel: the first one whose mask contains the line.
static const struct gpio_v2_line_attribute *attribute(unsigned index, uint32_t id)
{
    const struct gpio_v2_line_config *config = &gpio.request.config;
    for (unsigned at = 0; at < config->num_attrs; at++)
        if (config->attrs[at].attr.id == id && config->attrs[at].mask >> index & 1)
            return &config->attrs[at].attr;
    return NULL;
}

static uint64_t flags(unsigned index)
{
    const struct gpio_v2_line_attribute *own = attribute(index, GPIO_V2_LINE_ATTR_ID_FLAGS);
    return own ? own->flags : gpio.request.config.flags;
}

// The rules of the kernel for the flags of a line, as far as a program may break them.
static bool valid(uint64_t flags)
{
    bool input = flags & GPIO_V2_LINE_FLAG_INPUT, output = flags & GPIO_V2_LINE_FLAG_OUTPUT;
    uint64_t edges = flags & (GPIO_V2_LINE_FLAG_EDGE_RISING | GPIO_V2_LINE_FLAG_EDGE_FALLING);
    return input != output && (input || !edges);
}

int request_lines(void *request)
{
    struct gpio_v2_line_request *wanted = request;
    if (gpio.request.num_lines)
        return EBUSY;
    if (!wanted->num_lines || wanted->num_lines > GPIO_V2_LINES_MAX ||
        wanted->config.num_attrs > GPIO_V2_LINE_NUM_ATTRS_MAX)
        return EINVAL;
    gpio.request = *wanted;
    for (unsigned index = 0; index < wanted->num_lines; index++) {
        unsigned line = wanted->offsets[index];
        if (line >= LINES || !valid(flags(index)))
            return EINVAL;
        gpio.pins[index] = avr_io_getirq(chip, AVR_IOCTL_IOPORT_GETIRQ(GPIO_PORT(line)), (int)(line % 8));
        const struct gpio_v2_line_attribute *values = attribute(index, GPIO_V2_LINE_ATTR_ID_OUTPUT_VALUES);
        if (flags(index) & GPIO_V2_LINE_FLAG_OUTPUT)
            avr_raise_irq(gpio.pins[index], values && values->values >> index & 1);
        else if (flags(index) & GPIO_V2_LINE_FLAG_EDGE_RISING)
            avr_irq_register_notify(gpio.pins[index], edge_came, (void *)(uintptr_t)index);
    }
    gpio.request.fd = wanted->fd = open("/dev/null", O_RDWR | O_CLOEXEC);
    return 0;
}

int line_values(int descriptor, void *values, bool set)
{
    struct gpio_v2_line_values *lines = values;
    if (!are_lines(descriptor) || !lines->mask || lines->mask >> gpio.request.num_lines)
        return EINVAL;
    for (unsigned index = 0; index < gpio.request.num_lines; index++) {
        if (!(lines->mask >> index & 1))
            continue;
        if (set && !(flags(index) & GPIO_V2_LINE_FLAG_OUTPUT))
            return EPERM;
        if (set)
            avr_raise_irq(gpio.pins[index], lines->bits >> index & 1);
        else
            lines->bits = (lines->bits & ~(1ULL << index)) | (uint64_t)(gpio.pins[index]->value != 0) << index;
    }
    return 0;
}

bool are_lines(int descriptor) { return gpio.request.num_lines && descriptor == gpio.request.fd; }

bool take_edge(struct gpio_v2_line_event *event)
{
    if (!edge_waits())
        return false;
    *event = gpio.waiting[gpio.edge_out++ % EDGES];
    return true;
}

/* The program. */

void set_terminal(int descriptor) { gpio.terminal = descriptor; }

void program_waits(bool heard)
{
    if (heard)
        gpio.last_byte = chip->cycle;
    if (!gpio.ready)
        parent_report_ready(options.link ? options.link : ptsname(gpio.terminal));
    gpio.ready = true;
    if (chip->cycle - gpio.last_slice < SLICE)
        return;
    gpio.last_slice = chip->cycle;
    parent_poll(chip);
    keep_pace(chip);
}

bool sends_too_early(int descriptor) { return descriptor >= 0 && descriptor == gpio.terminal && ranging_listens(); }

// The options of the emulator are in a variable of the environment, one word a line.
__attribute__((constructor)) static void start(void)
{
    char *words[64], *left = getenv(EMULATOR_OPTIONS);
    int count = 0;
    if (!left)
        die("start the program with the emulator");
    while (count < 63 && (words[count] = strsep(&left, "\n")))
        count++;
    words[count] = NULL;
    read_options(count, words);
    optind = 0; // for the options of the program itself
    unsetenv("LD_PRELOAD");
    chip = avr_make_mcu_by_name("atmega2560");
    avr_init(chip);
    chip->frequency = FREQUENCY;
    ranging_start(chip, options.temperature);
    turntable_start(chip, options.initial_degrees);
}
