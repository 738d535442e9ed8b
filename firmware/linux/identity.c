#include "identity.h"

#include <err.h> // err
#include <fcntl.h> // open
#include <stdio.h> // snprintf
#include <string.h> // memset
#include <time.h> // clock_gettime
#include <unistd.h> // pread

#include "board_facts.h" // board_serial
#include "hardware.h" // boot_count

#define BLANK 0xFF // as in an erased EEPROM

// as in the EEPROM of an AVR
static struct {
    uint32_t boots;
    char serial[16];
    uint8_t wiring;
} stored;

static const char *name;
static int file;

// Without fsync, which would delay steps: the kernel writes to the disk later.
static void save(void)
{
    if (pwrite(file, &stored, sizeof stored, 0) != sizeof stored)
        err(1, "%s: cannot write", name);
}

static void invent_serial(void)
{
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    snprintf(stored.serial, sizeof stored.serial, "SONAR-%06lX", (unsigned long)(now.tv_nsec ^ now.tv_sec) & 0xFFFFFF);
}

void identity_start(const char *path)
{
    name = path;
    file = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (file < 0)
        err(1, "%s: cannot open or create the file that keeps serial number and wiring", path);
    memset(&stored, BLANK, sizeof stored);
    ssize_t size = pread(file, &stored, sizeof stored, 0);
    if (size < 0)
        err(1, "%s: cannot read", path);
    if (size && size < (ssize_t)sizeof stored)
        errx(1, "%s: %zd bytes, expected %zu; it is no file of this firmware", path, size, sizeof stored);
    stored.boots += 1 + (stored.boots == UINT32_MAX);
    if ((uint8_t)stored.serial[0] == BLANK)
        invent_serial();
    if (stored.wiring == BLANK)
        stored.wiring = 0;
    save();
}

uint32_t boot_count(void) { return stored.boots; }

uint8_t stored_wiring(void) { return stored.wiring; }

void store_wiring(uint8_t wiring)
{
    if (wiring == stored.wiring)
        return;
    stored.wiring = wiring;
    save();
}

static struct text text_of(const char *bytes, size_t most) { return (struct text){bytes, (uint8_t)strnlen(bytes, most)}; }

struct text board_firmware(void) { return text_of("sonarhw-linux 0.1.0", 64); }

struct text board_serial(void) { return text_of(stored.serial, sizeof stored.serial); }

struct text board_profile(void) { return text_of(PROFILE, 64); }
