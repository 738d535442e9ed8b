#include "limits.h"

#include "angles.h" // STEPS_OF_DEGREES
#include "board_facts.h" // REACH_DEGREES
#include "homing_facts.h" // ONE_SWITCH_REACH_DEGREES
#include "wiring.h" // one_switch

int16_t turntable_reach(void) { return one_switch() ? ONE_SWITCH_REACH_DEGREES : REACH_DEGREES; }

bool turntable_reaches(int64_t microdegrees)
{
    int32_t reach = turntable_reach() * 1000000L;
    return microdegrees >= -reach && microdegrees <= reach;
}

int32_t homing_limit(void)
{
    return one_switch() ? STEPS_OF_DEGREES(ONE_SWITCH_LIMIT_DEGREES) : STEPS_OF_DEGREES(HOMING_LIMIT_DEGREES);
}

bool within_homing_limit(int32_t steps) { return steps > -homing_limit() && steps < homing_limit(); }

int32_t homing_most(void)
{
    if (one_switch())
        return wiring_proven() ? STEPS_OF_DEGREES(ONE_SWITCH_MOST_DEGREES) : STEPS_OF_DEGREES(ONE_SWITCH_UNPROVEN_DEGREES);
    return wiring_proven() ? INT32_MAX : STEPS_OF_DEGREES(UNPROVEN_DEGREES);
}

int32_t creep_most(void)
{
    return one_switch() ? STEPS_OF_DEGREES(ONE_SWITCH_CREEP_DEGREES) : STEPS_OF_DEGREES(CREEP_DEGREES);
}
