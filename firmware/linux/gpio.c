#include "gpio.h"

#include <err.h> // err
#include <errno.h>
#include <fcntl.h> // open
#include <stddef.h>
#include <string.h> // strcpy
#include <sys/ioctl.h>
#include <unistd.h> // close

#include <linux/gpio.h>

#include "clock.h"

enum { OUTPUTS_HIGH, EDGES, PULLED_UP, ATTRIBUTES }; // in the request

static struct gpio_v2_line_request request;
static uint8_t index_of[256]; // of a line in the request
static int lines = -1;

static uint64_t add(uint8_t line)
{
    index_of[line] = (uint8_t)request.num_lines;
    request.offsets[request.num_lines] = line;
    return 1ULL << request.num_lines++;
}

void gpio_output(uint8_t line, bool high)
{
    struct gpio_v2_line_config_attribute *outputs = &request.config.attrs[OUTPUTS_HIGH];
    uint64_t bit = add(line);
    outputs->mask |= bit;
    if (high)
        outputs->attr.values |= bit;
}

void gpio_input(uint8_t line, enum gpio_input kind)
{
    request.config.attrs[kind == GPIO_EDGES ? EDGES : PULLED_UP].mask |= add(line);
}

void gpio_start(const char *chip)
{
    struct gpio_v2_line_config *config = &request.config;
    config->flags = GPIO_V2_LINE_FLAG_OUTPUT;
    config->num_attrs = ATTRIBUTES;
    config->attrs[OUTPUTS_HIGH].attr.id = GPIO_V2_LINE_ATTR_ID_OUTPUT_VALUES;
    config->attrs[EDGES].attr.id = config->attrs[PULLED_UP].attr.id = GPIO_V2_LINE_ATTR_ID_FLAGS;
    config->attrs[EDGES].attr.flags =
        GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_EDGE_RISING | GPIO_V2_LINE_FLAG_EDGE_FALLING;
    config->attrs[PULLED_UP].attr.flags = GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_BIAS_PULL_UP;
    strcpy(request.consumer, "sonarhw");
    int descriptor = open(chip, O_RDWR | O_CLOEXEC);
    if (descriptor < 0)
        err(1, "%s: cannot open the GPIO chip; does it exist, and are you in the group gpio?", chip);
    if (ioctl(descriptor, GPIO_V2_GET_LINE_IOCTL, &request))
        err(1, "%s: cannot take the lines of pins.h; gpioinfo lists who uses them", chip);
    close(descriptor);
    lines = request.fd;
    fcntl(lines, F_SETFL, O_NONBLOCK);
}

int gpio_descriptor(void) { return lines; }

bool gpio_next_edge(struct gpio_edge *edge)
{
    struct gpio_v2_line_event event;
    if (read(lines, &event, sizeof event) != sizeof event)
        return false;
    *edge = (struct gpio_edge){clock_since_start(event.timestamp_ns), event.id == GPIO_V2_LINE_EVENT_RISING_EDGE};
    return true;
}

bool gpio_read(uint8_t line)
{
    struct gpio_v2_line_values values = {.mask = 1ULL << index_of[line]};
    if (ioctl(lines, GPIO_V2_LINE_GET_VALUES_IOCTL, &values))
        err(1, "cannot read GPIO %d", line);
    return values.bits & values.mask;
}

void gpio_write(uint8_t line, bool high)
{
    uint64_t bit = 1ULL << index_of[line];
    struct gpio_v2_line_values values = {.bits = high ? bit : 0, .mask = bit};
    if (ioctl(lines, GPIO_V2_LINE_SET_VALUES_IOCTL, &values))
        err(1, "cannot set GPIO %d", line);
}

void gpio_hold(uint64_t since_ns, uint32_t ns)
{
    while (clock_ns() < since_ns + ns)
        ;
}
