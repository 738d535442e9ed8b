/* Loads and runs the firmware. */
#include "emulator.h"

#include <errno.h>
#include <fcntl.h>
#include <gelf.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include <simavr/avr_eeprom.h>
#include <simavr/avr_extint.h>
#include <simavr/avr_timer.h>
#include <simavr/avr_watchdog.h>
#include <simavr/sim_elf.h>
#include <simavr/sim_time.h>

#define SLICE (FREQUENCY / 1000) // cycles between two polls of line and parent process
#define START (FREQUENCY / 20) // cycles for the start, before the board reports that it is ready
#define VECTOR_SIZE 4 // bytes
#define ENTRY_CYCLES 5 // from the interrupt to its vector; simavr omits them
#define SERIAL_AT 4 // stored_serial in identity.c
#define EMULATED_SERIAL "EMULATED" // as in sonarhw/wire/readings_of_frames.py
#define STORED 24 // bytes that the Linux program keeps

static volatile sig_atomic_t ending;
static avr_t *chip;

void die(const char *why)
{
    fprintf(stderr, "emulated board: %s\n", why);
    line_end();
    exit(1);
}

bool end_requested(void) { return ending; }

double seconds(const avr_t *avr) { return (double)avr->cycle / FREQUENCY; }

// Address of a variable in the chip's memory.
static uint16_t symbol(const char *name)
{
    int file = open(options.elf, O_RDONLY);
    elf_version(EV_CURRENT);
    Elf *elf = file < 0 ? NULL : elf_begin(file, ELF_C_READ, NULL);
    for (Elf_Scn *section = NULL; elf && (section = elf_nextscn(elf, section));) {
        GElf_Shdr header;
        if (!gelf_getshdr(section, &header) || header.sh_type != SHT_SYMTAB)
            continue;
        Elf_Data *data = elf_getdata(section, NULL);
        for (size_t at = 0; at < header.sh_size / header.sh_entsize; at++) {
            GElf_Sym entry;
            gelf_getsym(data, (int)at, &entry);
            if (strcmp(elf_strptr(elf, header.sh_link, entry.st_name), name))
                continue;
            elf_end(elf);
            close(file);
            return (uint16_t)entry.st_value;
        }
    }
    die("a variable that the emulator needs is missing in the firmware; build both again");
    return 0;
}

// struct place of core/scan/scan.h: sweep u16, ping u8, angle i32; compilers for this chip add no padding
struct ping current_ping(const avr_t *avr)
{
    static uint16_t place;
    if (!place)
        place = symbol("ping_place");
    struct ping ping = {.index = avr->data[place + 2]};
    memcpy(&ping.sweep, avr->data + place, 2);
    return ping;
}

// The firmware uses no external interrupts. After a reset, simavr checks each of their pins that is low in every cycle,
// which makes an Uno, where such pins are in use, four times slower.
static void ignore_levels(avr_t *avr)
{
    for (uint8_t number = 0; number < EXTINT_COUNT; number++)
        avr_extint_set_strict_lvl_trig(avr, number, 0);
}

// After a reset of the chip, restore what simavr has cleared: timers and the levels of input pins.
static void after_reset(avr_t *avr)
{
    ignore_levels(avr);
    restore_pins(avr);
    ranging_reset(avr);
    turntable_reset(avr);
    line_reset();
}

void reset_board(avr_t *avr)
{
    avr_reset(avr);
    avr_regbit_set(avr, avr->reset_flags.extrf);
    after_reset(avr);
}

static void brown_out(avr_t *avr)
{
    avr_reset(avr);
    avr_regbit_set(avr, avr->reset_flags.borf);
    after_reset(avr);
}

void hang_board(avr_t *avr)
{
    static uint8_t jump_to_itself[] = {0xFF, 0xCF};
    avr_loadcode(avr, jump_to_itself, sizeof jump_to_itself, avr->flashend - 1);
    avr->pc = avr->flashend - 1;
}

static void read_eeprom(avr_t *avr)
{
    uint8_t bytes[options.controller->eeprom];
    memset(bytes, 0xFF, sizeof bytes);
    FILE *file = options.eeprom ? fopen(options.eeprom, "rb") : NULL;
    if (file) {
        if (!fread(bytes, 1, sizeof bytes, file))
            die("cannot read the EEPROM file");
        fclose(file);
    }
    if (!options.eeprom) // a log of the emulated board must not look like a log of a real one
        memcpy(bytes + SERIAL_AT, EMULATED_SERIAL, sizeof EMULATED_SERIAL);
    avr_eeprom_desc_t all = {.ee = bytes, .offset = 0, .size = options.controller->eeprom};
    avr_ioctl(avr, AVR_IOCTL_EEPROM_SET, &all);
}

static void write_eeprom(avr_t *avr)
{
    avr_eeprom_desc_t all = {.ee = NULL, .offset = 0, .size = options.controller->eeprom};
    avr_ioctl(avr, AVR_IOCTL_EEPROM_GET, &all);
    FILE *file = options.eeprom ? fopen(options.eeprom, "wb") : NULL;
    if (file) {
        fwrite(all.ee, 1, all.size, file);
        fclose(file);
    }
}

void switch_off(void)
{
    write_eeprom(chip);
    line_end();
    exit(0);
}

static avr_io_write_t clear_timer_flags;

// A write to the flags of a timer clears those whose bit is 1. simavr clears all that are set, so hide the others from it.
static void write_timer_flags(avr_t *avr, avr_io_addr_t flags, uint8_t value, void *timer)
{
    uint8_t kept = avr->data[flags] & ~value;
    avr->data[flags] &= value;
    clear_timer_flags(avr, flags, value, timer);
    avr->data[flags] |= kept;
}

static void keep_timer_flags(avr_t *avr)
{
    for (avr_io_t *part = avr->io_port; part; part = part->next) {
        if (strcmp(part->kind, "timer"))
            continue;
        int flags = AVR_DATA_TO_IO(((avr_timer_t *)part)->overflow.raised.reg);
        clear_timer_flags = avr->io[flags].w.c;
        avr->io[flags].w.c = write_timer_flags;
    }
}

static avr_cycle_count_t slice_end; // the models and the line are served then

static avr_cycle_count_t next_event(const avr_t *avr)
{
    const avr_cycle_timer_slot_t *timer = avr->cycle_timers.timer;
    return timer && timer->when < slice_end ? timer->when : slice_end;
}

// Whether the variables are the same as at the last call, but for the sum of the thermometer, which changes with each
// conversion. What stands on the stack is no state: the main loop keeps nothing there from one pass to the next.
static bool variables_unchanged(const avr_t *avr)
{
    static uint8_t before[UINT16_MAX + 1];
    static uint16_t sum, summed, end;
    if (!sum) {
        sum = symbol("sum");
        summed = symbol("summed");
        end = symbol("_end");
    }
    memcpy(before + sum, avr->data + sum, 2);
    before[summed] = avr->data[summed];
    uint16_t first = avr->ioend + 1;
    bool unchanged = !memcmp(before + first, avr->data + first, end - first);
    memcpy(before + first, avr->data + first, end - first);
    return unchanged;
}

// The main loop of the firmware resets the watchdog once a pass. After a pass that has changed nothing, the next ones
// change nothing either until something happens in the chip: an interrupt, a byte, the end of a conversion. So advance
// the time to that event, as simavr does while a chip sleeps. The converter of the thermometer runs without a pause, so
// the main loop is delayed by at most one conversion, 0.1 ms; no interrupt is late.
static int skip_idle_passes(avr_io_t *watcher, uint32_t request, void *unused)
{
    (void)unused;
    avr_t *avr = watcher->avr;
    if (request == AVR_IOCTL_WATCHDOG_RESET && variables_unchanged(avr) && !avr->interrupt_state &&
        next_event(avr) > avr->cycle + 1) {
        avr->cycle = next_event(avr) - 1; // this instruction takes one cycle
        avr->run_cycle_count = 0; // simavr processes its timers after this instruction
    }
    return -1; // the watchdog gets the request too
}

static avr_t *make_chip(void)
{
    elf_firmware_t firmware = {0};
    if (elf_read_firmware(options.elf, &firmware))
        die("cannot read the firmware file");
    avr_t *avr = avr_make_mcu_by_name(options.controller->chip);
    if (!avr)
        die("this libsimavr does not support the chip");
    avr_init(avr);
    avr->frequency = FREQUENCY;
    avr->log = LOG_ERROR;
    avr->vcc = avr->avcc = avr->aref = 5000;
    // keep_pace controls the speed, not simavr
    avr_load_firmware(avr, &firmware);
    keep_timer_flags(avr);
    ignore_levels(avr);
    static avr_io_t watcher = {.kind = "idle", .ioctl = skip_idle_passes};
    avr_register_io(avr, &watcher);
    return avr;
}

static void end(int signal)
{
    (void)signal;
    ending = 1;
}

static void never_sleep(avr_t *avr, avr_cycle_count_t cycles)
{
    (void)avr;
    (void)cycles;
}

#define AT_ONCE 1000 // cycles; less than SLICE

static uint32_t longest[INTERRUPTS];

const uint32_t *longest_interrupts(void) { return longest; }

// Measure the duration of interrupt handlers, from the vector to RETI. Only they need a return from simavr after each
// instruction; elsewhere it may run until the next of its timers.
static void time_interrupts(avr_t *avr, avr_flashaddr_t before)
{
    static unsigned vector;
    static avr_cycle_count_t began;
    if (avr->pc < INTERRUPTS * VECTOR_SIZE && avr->pc % VECTOR_SIZE == 0) {
        vector = avr->pc / VECTOR_SIZE;
        began = avr->cycle - ENTRY_CYCLES;
    } else if (vector && avr->flash[before] == 0x18 && avr->flash[before + 1] == 0x95) { // RETI
        if (avr->cycle - began > longest[vector])
            longest[vector] = (uint32_t)(avr->cycle - began);
        vector = 0;
    }
    avr->run_cycle_limit = vector ? 1 : AT_ONCE;
    if (vector)
        avr->run_cycle_count = 1;
}

static void run_for(avr_t *avr, avr_cycle_count_t cycles)
{
    avr_cycle_count_t end = slice_end = avr->cycle + cycles;
    while (avr->cycle < end) {
        avr_flashaddr_t before = avr->pc;
        int state = avr_run(avr);
        ranging_time_conversion(avr);
        if (state == cpu_Done || state == cpu_Crashed)
            die("the firmware crashed");
        if (avr->pc == 0) {
            after_reset(avr);
            return;
        }
        if (miswired(SUPPLY_WEAK) && ranging_listens()) {
            brown_out(avr);
            return;
        }
        time_interrupts(avr, before);
    }
}

// A file in memory with the serial number of an emulated board.
static const char *emulated_eeprom(void)
{
    static char name[32];
    uint8_t bytes[STORED] = {0};
    memcpy(bytes + SERIAL_AT, EMULATED_SERIAL, sizeof EMULATED_SERIAL);
    int file = memfd_create("eeprom", 0);
    if (write(file, bytes, sizeof bytes) != sizeof bytes)
        die("cannot write the EEPROM");
    snprintf(name, sizeof name, "/proc/self/fd/%d", file);
    return name;
}

// Run a Linux program on an emulated GPIO chip instead: a library in the folder of the emulator, which gets the options.
static void run_program(int count, char **words)
{
    char joined[4096] = "", library[4096];
    for (int at = 0; at < count; at++) {
        strncat(joined, at ? "\n" : "", sizeof joined - strlen(joined) - 1);
        strncat(joined, words[at], sizeof joined - strlen(joined) - 1);
    }
    ssize_t size = readlink("/proc/self/exe", library, sizeof library - 32);
    library[size < 0 ? 0 : size] = 0;
    strcpy(strrchr(library, '/') + 1, "emulated-gpio.so");
    setenv(EMULATOR_OPTIONS, joined, 1);
    setenv("LD_PRELOAD", library, 1);
    const char *eeprom = options.eeprom ? options.eeprom : emulated_eeprom();
    execl(options.elf, options.elf, "--eeprom", eeprom, options.link ? "--link" : NULL, options.link, NULL);
    die("cannot run the firmware file");
}

int main(int count, char **words)
{
    read_options(count, words);
    // simavr prints what it loads to standard output, which belongs to the parent process
    if (!freopen("/dev/null", "w", stdout))
        die("cannot open /dev/null");
    if (!options.controller->chip)
        run_program(count, words);
    // without SA_RESTART, so that a signal ends a read from a parent that does not answer
    const struct sigaction ends = {.sa_handler = end};
    sigaction(SIGTERM, &ends, NULL);
    sigaction(SIGINT, &ends, NULL);
    signal(SIGPIPE, SIG_IGN);
    avr_t *avr = chip = make_chip();
    avr->sleep = never_sleep;
    read_eeprom(avr);
    ranging_start(avr, options.temperature);
    turntable_start(avr, options.initial_degrees);
    line_start(avr, options.link, options.any_baud);
    run_for(avr, START);
    parent_report_ready(line_name());
    while (!ending) {
        run_for(avr, SLICE);
        line_poll(avr);
        parent_poll(avr);
        keep_pace(avr);
    }
    switch_off();
}
