/* Constants of the 6500 ranging board. */
#ifndef RANGING_FACTS_H
#define RANGING_FACTS_H

#define BLANKING_US 2380 // of the board itself
#define BLANKING_LEAST_US 500 // earlier edges of ECHO are noise of the transmitter
#define REARM_LEAST_US 440 // BLNK must be high for this long before the next echo
#define PULSES_SENT 16
#define PING_PERIOD_US 100000 // the echoes of a ping must decay before the next
#define LISTEN_MOST_US 62400 // 10.7 m; duration of 4 800 samples
#define LOST_MOST 32 // samples of a trace that can be marked as lost
#define ECHOES_BESIDE_TRACE 8 // with a trace; without one, echoes use its buffer

#endif
