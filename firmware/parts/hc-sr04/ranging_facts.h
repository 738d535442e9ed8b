/* Constants of the HC-SR04 module. It detects the first echo only, and sends no trace. */
#ifndef RANGING_FACTS_H
#define RANGING_FACTS_H

#define PROFILE "hc-sr04"
#define RANGING_FEATURES 0
#define BLANKING_US 116 // 20 mm; cannot be set
#define BLANKING_LEAST_US BLANKING_US
#define BLANKING_MOST_US BLANKING_US
#define REARM_LEAST_US 0
#define REARM_MOST_US 0 // never: one echo only
#define PULSES_SENT 8
#define PING_PERIOD_US 100000 // the echoes of a ping must decay before the next
#define LISTEN_MOST_US 30000UL // 5.1 m; ECHO is high for longer only if there is no echo
#define ECHOES_DETECTED 1
#define ECHOES_BESIDE_TRACE 1

#endif
