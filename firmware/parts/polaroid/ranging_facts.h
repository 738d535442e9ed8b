/* Constants of the 6500 ranging board. */
#ifndef RANGING_FACTS_H
#define RANGING_FACTS_H

#define PROFILE "polaroid-6500"
#define RANGING_FEATURES (FEATURE_BLANKING | FEATURE_REARM)
#define BLANKING_US 2380 // of the board itself
#define BLANKING_LEAST_US 500 // earlier edges of ECHO are noise of the transmitter
#define BLANKING_MOST_US 0xFFFFFFFF // any
#define REARM_LEAST_US 440 // BLNK must be high for this long before the next echo
#define REARM_MOST_US 0xFFFF // any
#define PULSES_SENT 16
#define PING_PERIOD_US 100000 // the echoes of a ping must decay before the next
#define LISTEN_MOST_US 62400 // 10.7 m; duration of 4 800 samples
#define ECHOES_DETECTED 122 // as many as the protocol allows
#define ECHOES_BESIDE_TRACE 8 // with a trace; without one, echoes use its memory

#endif
