"""Python reads this as it starts in a program that a test starts: the network is refused there, too."""

from refused import refuse

refuse()
