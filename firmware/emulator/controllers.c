/* The controllers that can be emulated. */
#include <string.h>

#include "emulator.h"

#define GPIO(line) {GPIO_PORT(line), (line) % 8}

static const struct controller controllers[] = {
    {
        .name = "mega",
        .chip = "atmega2560",
        .eeprom = 4096,
        .init = {'C', 0},
        .blnk = {'C', 1},
        .binh = {'C', 2},
        .echo = {'L', 0},
        .step = {'A', 0},
        .direction = {'A', 1},
        .enable = {'A', 2},
        .mark = {'A', 3},
        .cam = {'A', 4},
    },
    {
        .name = "uno",
        .chip = "atmega328p",
        .eeprom = 1024,
        .init = {'D', 7},
        .blnk = {'D', 6},
        .binh = {'D', 5},
        .echo = {'B', 0},
        .step = {'D', 2},
        .direction = {'D', 3},
        .enable = {'D', 4},
        .mark = {'B', 3},
        .cam = {'B', 4},
        .coils = {{'B', 1}, {'B', 2}, {'B', 3}, {'B', 4}},
        .servo = {'B', 2},
    },
    {
        .name = "linux",
        .init = GPIO(23),
        .blnk = GPIO(25),
        .binh = GPIO(22),
        .echo = GPIO(24),
        .step = GPIO(17),
        .direction = GPIO(27),
        .enable = GPIO(6),
        .mark = GPIO(20),
        .cam = GPIO(21),
        .coils = {GPIO(12), GPIO(13), GPIO(16), GPIO(26)},
    },
};

const struct controller *controller_of(const char *combination)
{
    for (size_t at = 0; at < sizeof controllers / sizeof *controllers; at++)
        if (!strncmp(controllers[at].name, combination, strlen(controllers[at].name)))
            return &controllers[at];
    return NULL;
}
