/* Constants of an ATmega328P as on the Arduino Uno and Nano: 2 KB of memory for variables and the stack. */
#ifndef CHIP_FACTS_H
#define CHIP_FACTS_H

#define CHIP "uno"
#define SEND_ROOM 64 // bytes
#define ECHO_ROOM 16 // of a reading
#define KEPT_STORE 328 // bytes
#define USART_RECEIVED_vect USART_RX_vect
#define USART_SENT_vect USART_UDRE_vect

#endif
