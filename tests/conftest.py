"""Puts tests/ itself on the import path, for the fakes that several folders share."""

import signal

# A shell that runs the tests in the background, or nohup, leaves signals ignored, and children inherit that: without
# this, tests that interrupt a process would wait for ever.
for _number, _usual in ((signal.SIGINT, signal.default_int_handler), (signal.SIGHUP, signal.SIG_DFL)):
    if signal.getsignal(_number) is signal.SIG_IGN:
        signal.signal(_number, _usual)
