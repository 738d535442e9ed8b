/* The options of the emulator. */
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "emulator.h"

struct options options = {.pace = 1, .initial_degrees = 0, .temperature = NAN};

// The parts in a name such as uno-hc-sr04-servo.
static void choose_parts(const char *name)
{
    options.controller = controller_of(name);
    options.ranging = strstr(name, "-hc-sr04-") ? HC_SR04 : POLAROID;
    options.turning = strstr(name, "-servo") ? SERVO : strstr(name, "-28byj") ? FOUR_COILS : STEP_DIR;
}

void read_options(int count, char **words)
{
    static const struct option known[] = {
        {"combination", required_argument, NULL, 'c'},
        {"firmware", required_argument, NULL, 'f'}, {"eeprom", required_argument, NULL, 'e'},
        {"link", required_argument, NULL, 'l'},     {"pace", required_argument, NULL, 'p'},
        {"stands", required_argument, NULL, 's'},   {"temperature", required_argument, NULL, 't'},
        {"any-baud", no_argument, NULL, 'a'},       {"parent", required_argument, NULL, 'd'},
        {"miswire", required_argument, NULL, 'm'},  {"stall", required_argument, NULL, 'w'},
        {NULL, 0, NULL, 0},
    };
    for (int option; (option = getopt_long(count, words, "", known, NULL)) != -1;) {
        switch (option) {
        case 'c':
            choose_parts(optarg);
            break;
        case 'f':
            options.elf = optarg;
            break;
        case 'e':
            options.eeprom = optarg;
            break;
        case 'l':
            options.link = optarg;
            break;
        case 'p':
            options.pace = atof(optarg);
            break;
        case 's':
            options.initial_degrees = atof(optarg);
            break;
        case 't':
            options.temperature = atof(optarg);
            break;
        case 'a':
            options.any_baud = true;
            break;
        case 'm':
            options.wiring = (uint32_t)atol(optarg);
            break;
        case 'w':
            options.stall = atof(optarg);
            break;
        case 'd':
            parent_start(atoi(optarg));
            break;
        default:
            exit(2);
        }
    }
    if (!options.elf || !options.controller)
        die("--firmware FILE.elf or --combination mega-polaroid-step-dir is missing");
}
