"""The host side of the protocol, from what programs use down to single frames:

    Scanner                 one action at a time: configure, home, turn, scan
      LinkThread            the only thread: opens the port, exchanges bytes, opens it again after a loss
        Session             one device over any number of losses; runs the script of the present Job
          Conversation      from one Hello to the loss of the device; runs the scripts of greeting and actions
            Driver          repeats commands, requests missing readings, sends signs of life

From Session on, nothing has a thread, a port or a clock: tests run hours of scanning in seconds.
"""
