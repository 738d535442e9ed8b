#ifndef USART_H
#define USART_H

#include <stdbool.h>

void usart_start(void);
bool usart_idle(void); // every byte has been sent, and every received byte has been read

#endif
