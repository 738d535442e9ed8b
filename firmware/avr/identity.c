#include "identity.h"

#include <avr/eeprom.h> // eeprom_read_block

#include "board_facts.h" // board_serial
#include "hardware.h" // clock_us

#define SERIAL_MOST 16
#define BLANK 0xFF // erased EEPROM

// the addresses must not change: avrdude may write a serial number there
static EEMEM struct {
    uint32_t boots;
    uint8_t serial[SERIAL_MOST];
    uint8_t wiring;
} stored;

static uint32_t boots;
static char serial[SERIAL_MOST];

void identity_start(void)
{
    boots = eeprom_read_dword(&stored.boots) + 1;
    if (!boots) // erased EEPROM
        boots = 1;
    eeprom_update_dword(&stored.boots, boots);
    eeprom_read_block(serial, stored.serial, SERIAL_MOST);
}

uint32_t boot_count(void) { return boots; }

uint8_t stored_wiring(void)
{
    uint8_t wiring = eeprom_read_byte(&stored.wiring);
    return wiring == BLANK ? 0 : wiring;
}

void store_wiring(uint8_t wiring) { eeprom_update_byte(&stored.wiring, wiring); }

// The time of the first Hello serves as a random number.
static void invent_serial(void)
{
    static const char letters[] = "SONAR-";
    uint32_t lot = (uint32_t)clock_us();
    uint8_t at = 0;
    for (; letters[at]; at++)
        serial[at] = letters[at];
    for (; at < 12; at++, lot >>= 4) {
        uint8_t digit = lot & 15;
        serial[at] = (char)(digit < 10 ? '0' + digit : 'A' + digit - 10);
    }
    serial[at] = 0;
    eeprom_update_block(serial, stored.serial, SERIAL_MOST);
}

struct text board_serial(void)
{
    if ((uint8_t)serial[0] == BLANK)
        invent_serial();
    uint8_t size = 0;
    while (size < SERIAL_MOST && serial[size])
        size++;
    return (struct text){serial, size};
}

static const char firmware[] = "sonarhw-" CHIP " 0.1.0";
static const char profile[] = PROFILE;

struct text board_firmware(void) { return (struct text){firmware, sizeof firmware - 1}; }

struct text board_profile(void) { return (struct text){profile, sizeof profile - 1}; }
