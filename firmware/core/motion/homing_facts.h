/* Constants of homing, for turntables of any gear. */
#ifndef HOMING_FACTS_H
#define HOMING_FACTS_H

enum homing {
    HOMING_WITH_SWITCHES, // a mark on the axle and a cam
    HOMING_BY_HAND, // no switches: SetZero
    HOMING_ABSOLUTE, // a servo always has its angle
};

#define UNPROVEN_DEGREES 400 // limit of one Home towards the cam, until a Home has succeeded with the present wiring
#define MARK_WITHIN_DEGREES 200 // the level of the mark changes every 180 degrees
#define JOG_DEGREES 10 // largest jog
#define MARK_DEGREES 120 // greatest distance from the edge of the cam to the mark
#define CREEP_DEGREES 220 // a table that turns the wrong way finds the mark between these two
#define MISSING_DEGREES 5 // the mark is missing if not seen this far past its position; 64 steps are 3.2

#endif
