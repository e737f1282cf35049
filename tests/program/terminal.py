"""Runs a program in a pseudo terminal: terminal.py COLUMNS ANSWERS PROGRAM ARGUMENTS...

Standard input and standard error are the terminal. Prints all that the program wrote on it.
"""

import fcntl
import os
import pty
import struct
import subprocess
import sys
import termios

columns, answers, *command = sys.argv[1:]
ours, theirs = pty.openpty()
fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, int(columns), 0, 0))
program = subprocess.Popen(command, stdin=theirs, stdout=subprocess.DEVNULL, stderr=theirs)
os.close(theirs)
os.write(ours, answers.encode())
while True:
    try:
        part = os.read(ours, 4096)
    except OSError:  # The program has closed its end.
        break
    if not part:
        break
    sys.stdout.buffer.write(part)
sys.exit(program.wait())
