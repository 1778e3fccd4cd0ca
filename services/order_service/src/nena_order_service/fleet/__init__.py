"""Fleet control: the side of VDA 5050 that sends orders and reads states (3.0 section 6).

The core is pure: messages and the time, in monotonic seconds, go in; messages to send and events come out.
"""
