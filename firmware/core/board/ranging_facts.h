/* The 6500 ranging board, as the firmware uses it. */
#ifndef RANGING_FACTS_H
#define RANGING_FACTS_H

#define BLANKING_US 2380 // the board's own
#define BLANKING_LEAST_US 500 // ECHO means nothing earlier
#define REARM_LEAST_US 440 // BLNK high for as long makes it ready for the next echo
#define PULSES_SENT 16
#define PING_PERIOD_US 100000 // so that the echoes of one ping have died before the next
#define LISTEN_MOST_US 62400 // 10.7 m; what 4 800 samples last
#define ECHOES_BESIDE_TRACE 8 // while the store of the trace is in use; otherwise they are put there

#endif
