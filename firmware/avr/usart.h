#ifndef USART_H
#define USART_H

void usart_start(void);

#endif
