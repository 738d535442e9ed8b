#include "wiring.h"

#include "board_facts.h" // HOMING
#include "hardware.h" // home_mark
#include "homing_facts.h" // enum homing
#include "messages.h" // enum wiring

#define WIRING_PROVEN 0x40 // stored beside enum wiring

static uint8_t wiring;
static bool mark_inverted;

static void take(uint8_t settings)
{
    wiring = settings;
    mark_inverted = wiring & WIRING_MARK;
}

static void keep(uint8_t settings)
{
    take(settings);
    store_wiring(settings);
}

void wiring_reset(void) { take(stored_wiring()); }

void wiring_set(uint8_t change, uint8_t wanted) { keep((uint8_t)((wiring & ~(change | WIRING_PROVEN)) | wanted)); }

uint8_t wiring_now(void) { return wiring & (uint8_t)~WIRING_PROVEN; }

void wiring_prove(bool proven) { keep((uint8_t)((wiring & ~WIRING_PROVEN) | (proven ? WIRING_PROVEN : 0))); }

bool wiring_proven(void) { return wiring & WIRING_PROVEN; }

bool one_switch(void) { return HOMING == HOMING_WITH_SWITCHES && wiring & WIRING_ONE_SWITCH; }

bool motor_inverted(void) { return wiring & WIRING_MOTOR; }

bool marked_now(void) { return home_mark() != mark_inverted; }

bool above_zero(void) { return one_switch() ? marked_now() : home_side() != ((wiring & WIRING_CAM) != 0); }
