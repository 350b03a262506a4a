"""Teaching by example, live: commands and frames go in with their time, states and library changes come out."""

from kinespace.stream.teaching import commands
from kinespace.stream.teaching.commands import Asked, Changed, Command, Notice, State, Step, Taught, Told, Tried
from kinespace.stream.teaching.teacher import Remembered, Teacher
