/* Constants of an ATmega2560 as on the Arduino Mega 2560: 8 KB of memory for variables and the stack. */
#ifndef CHIP_FACTS_H
#define CHIP_FACTS_H

#define CHIP "mega"
#define SEND_ROOM 192 // bytes: 1.9 ms at 1 000 000 baud; meanwhile the CRC of the next chunk is computed
#define ECHO_ROOM 34 // of a reading
#define KEPT_STORE 616 // bytes
#define USART_RECEIVED_vect USART0_RX_vect
#define USART_SENT_vect USART0_UDRE_vect

#endif
