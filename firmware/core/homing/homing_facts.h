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

// With one switch, whose level shows the side of zero within half a turn. 3 degrees are left for steps that are lost.
#define ONE_SWITCH_REACH_DEGREES (177 - BACKLASH_DEGREES)
#define ONE_SWITCH_MOST_DEGREES 185 // limit of one Home towards the mark
#define ONE_SWITCH_UNPROVEN_DEGREES 60 // on each side, until a Home has succeeded with the present wiring
#define ONE_SWITCH_LIMIT_DEGREES 360 // of all Homes together, from where the board started or from the last zero
#define ONE_SWITCH_TRIES 3 // Homes without success, until the board is restarted
#define ONE_SWITCH_CREEP_DEGREES 60
#define CLEAR_DEGREES 5 // past the edge of the mark, before the table creeps back to it

#define MISSING_DEGREES 5 // the mark is missing if not seen this far past its position; 64 steps are 3.2

#endif
