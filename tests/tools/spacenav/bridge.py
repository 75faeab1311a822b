# SPDX-License-Identifier: GPL-3.0-or-later
"""wrenchd with a simulated hand, and wrenchd-spnav, which serves the hand's motion to programs of libspnav."""
import os
import shutil
import signal
import subprocess
import sys
import time


def enter(work):
    """Makes an empty directory and goes there."""
    shutil.rmtree(work, ignore_errors=True)
    os.makedirs(work)
    os.chdir(work)


def wait_for(condition, what, seconds=20):
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            sys.exit(f"{os.path.basename(sys.argv[0])}: {what} did not happen within {seconds} s")
        time.sleep(0.05)


def said(log, text):
    return lambda: text in open(log).read()


def write_hand(start_s, move_s, end_s):
    """hand.csv: 60 mm to the left at constant speed."""
    with open("hand.csv", "w") as file:
        file.write("time_s,px,py,pz,qx,qy,qz,qw\n")
        for step in range(int(2 * end_s)):
            y_m = 0.06 * min(1.0, max(0.0, (step / 2 - start_s) / move_s))
            file.write(f"{step / 2},0,{y_m},0.1,0,0,0,1\n")


class Bridge:
    """Starts programs in the present directory and ends them all. hand.csv is the path of the hand."""

    def __init__(self, programs):
        if not os.path.exists(f"{programs}/wrenchd-spnav"):
            sys.exit(f"{os.path.basename(sys.argv[0])}: no wrenchd-spnav in {programs}; give the directory of built programs")
        self.programs = programs
        self.control, self.spacenav = os.path.abspath("w.sock"), os.path.abspath("n.sock")
        self.environment = dict(os.environ, SPNAV_SOCKET=self.spacenav, WRENCHD_SOCKET=self.control,
                                XDG_STATE_HOME=os.getcwd())
        self.running = []

    def __enter__(self):
        try:
            self.start_both()
        except BaseException:  # Python then calls no __exit__
            self.__exit__()
            raise
        return self

    def start_both(self):
        self.bridge = self.start([f"{self.programs}/wrenchd-spnav"], "spnav.log")
        wait_for(said("spnav.log", "trying again"), "a message about the missing daemon")
        self.daemon = self.start([f"{self.programs}/wrenchd", "--control", self.control, "--playback", "hand.csv",
                                  "--playback-mode", "open", "--realtime", "off"], "daemon.log")
        wait_for(said("spnav.log", "connected to wrenchd: loopback"), "the connection to wrenchd")

    def __exit__(self, *_):
        for process in reversed(self.running):
            process.kill()
            process.wait()

    def start(self, command, log, **variables):
        self.running.append(subprocess.Popen(command, env=dict(self.environment, **variables), stdout=open(log, "w"),
                                             stderr=subprocess.STDOUT))
        return self.running[-1]

    def end(self):
        """Ends wrenchd, then wrenchd-spnav."""
        self.daemon.send_signal(signal.SIGTERM)
        wait_for(said("spnav.log", "the daemon is gone"), "the end of wrenchd in the log")
        self.bridge.send_signal(signal.SIGTERM)
        if self.bridge.wait(10) != 0:
            sys.exit("wrenchd-spnav ends with an error")
        if os.path.exists(self.spacenav):
            sys.exit("wrenchd-spnav leaves its socket behind")
