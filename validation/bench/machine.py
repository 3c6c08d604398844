"""Running programs on given cores, and what they tell: seconds, memory, the lines of the log."""
import os
import re
import shutil
import statistics
import subprocess
import sys
import time

NUMBER = r"([0-9.eE+-]+)"


class Failed(Exception):
    """A program ended in an error, or did not tell what was asked of it."""


class Run:
    """One run of a program: wall clock seconds, largest resident memory in bytes, what it printed."""

    def __init__(self, wall, memory, text):
        self.wall, self.memory, self.text = wall, memory, text

    def find(self, pattern):
        """The numbers of the first line that matches, None where there is none."""
        match = re.search(pattern, self.text)
        return [float(n) for n in match.groups()] if match else None

    def need(self, pattern):
        numbers = self.find(pattern)
        if numbers is None:
            raise Failed("no line of the log matches " + pattern)
        return numbers


def distinct_cores():
    """The processors that we may use, one of each core first."""
    allowed = sorted(os.sched_getaffinity(0))
    cores = {}
    for cpu in allowed:
        try:
            with open(f"/sys/devices/system/cpu/cpu{cpu}/topology/thread_siblings_list", encoding="ascii") as file:
                cores.setdefault(file.read().strip(), []).append(cpu)
        except OSError:
            cores[str(cpu)] = [cpu]
    first = [group[0] for group in cores.values()]
    return first + [cpu for cpu in allowed if cpu not in first]


def processor_name():
    """Its name, family and model, for one name may stand for several, and the widest vectors it has for networks."""
    facts = {}
    with open("/proc/cpuinfo", encoding="ascii", errors="replace") as file:
        for line in file:
            key, _, value = line.partition(":")
            facts.setdefault(key.strip(), value.strip())
    flags = facts.get("flags", "").split()
    about = [f"{key.removeprefix('cpu ')} {facts[key]}" for key in ("cpu family", "model") if key in facts]
    for flag, vectors in (("avx512_bf16", "AVX-512 and bfloat16"), ("avx512bw", "AVX-512"), ("avx2", "AVX2")):
        if flag in flags:
            about.append(vectors)
            break
    return facts.get("model name", "unknown") + (f" ({', '.join(about)})" if about else "")


def available_memory():
    """Bytes that can be had without swapping."""
    with open("/proc/meminfo", encoding="ascii") as file:
        for line in file:
            if line.startswith("MemAvailable"):
                return 1024 * int(line.split()[1])
    return 0


def free_disk(folder):
    return shutil.disk_usage(folder).free


def quartiles(samples):
    """Lower quartile, median, upper quartile (linear between order statistics)."""
    if len(samples) < 2:
        return samples[0], samples[0], samples[0]
    low, middle, high = statistics.quantiles(samples, n=4, method="inclusive")
    return low, middle, high


def median(samples):
    return statistics.median(samples)


class Machine:
    """Where and with what the benchmark runs."""

    def __init__(self, top, build, work):
        self.top, self.build, self.work = top, build, work
        self.cores = distinct_cores()
        self.threads = [1] if len(self.cores) < 2 else [1, 2]
        self.most = self.threads[-1]

    def say(self, text):
        print(text, file=sys.stderr, flush=True)

    def run(self, words, threads):
        """Run a program on so many cores and threads, in the scratch folder; its output is kept."""
        cores = set(self.cores[:threads])
        environment = dict(os.environ, LC_ALL="C.UTF-8", HOME=self.work, OMP_NUM_THREADS=str(threads),
                           OPENBLAS_NUM_THREADS=str(threads), MKL_NUM_THREADS=str(threads))
        with open(os.path.join(self.work, "output"), "w+b") as output:
            begun = time.monotonic()
            try:
                process = subprocess.Popen(words, cwd=self.work, env=environment, stdin=subprocess.DEVNULL,
                                           stdout=output, stderr=subprocess.STDOUT,
                                           preexec_fn=lambda: os.sched_setaffinity(0, cores))
            except OSError as error:
                raise Failed(f"{words[0]}: {error.strerror}") from error
            status, usage = self.wait(process)
            wall = time.monotonic() - begun
            output.seek(0)
            text = output.read().decode("utf-8", "replace")
        if status != 0:
            last = [line for line in text.splitlines() if line.strip()][-1:] or ["no message"]
            raise Failed(f"{os.path.basename(words[0])} ended with {status}: {last[0]}")
        return Run(wall, 1024 * usage.ru_maxrss, text)

    @staticmethod
    def wait(process):
        """Exit code and resources of a child, which does not outlive us."""
        try:
            _, status, usage = os.wait4(process.pid, 0)
        except BaseException:
            process.kill()
            process.wait()
            raise
        process.returncode = os.waitstatus_to_exitcode(status)
        return process.returncode, usage

    def limit(self, *words, threads):
        """Numbers by name, of validation/bench/limits."""
        text = self.run([os.path.join(self.build, "validation/bench/limits"), "-values", *words], threads).text
        return {line.split()[0]: float(line.split()[1]) for line in text.splitlines()}

    def model(self, name):
        """One of the networks in the box."""
        return os.path.join(self.top, "config", name)

    def rextract(self, tile, kind, threads, *words, columns="plain.param"):
        """The build on a tile, with the configuration that source-extractor gets, too."""
        command = [os.path.join(self.build, "rextract"), tile, "-c", "plain.sex", "-PARAMETERS_NAME", columns,
                   "-RESTORE_TYPE", kind, "-PSF_TYPE", "MOFFAT", "-PSF_FWHM", "4", "-NET_MODEL",
                   self.model("psfnet.fits"), "-NTHREADS", str(threads), "-CATALOG_NAME", "ours.cat"]
        if "-VERBOSE_TYPE" not in words:
            command += ["-VERBOSE_TYPE", "QUIET"]
        return self.run(command + list(words), threads)

    def restore(self, tile, kind, threads, *words):
        """The same for its restoration alone: no list worth speaking of. Told in seconds by restored()."""
        return self.rextract(tile, kind, threads, "-ERROR_CALIBRATION", "N", "-DETECT_THRESH", "20",
                             "-ANALYSIS_THRESH", "20", "-VERBOSE_TYPE", "FULL", *words)


def restored(run, kind):
    """Seconds of a restoration, by the log, to as many digits as it has."""
    own = run.need(rf"{kind}: .*chi2 [^,]*, {NUMBER} s")[0]
    finer = (run.find(rf"{kind}: seconds: restore {NUMBER}"),
             run.find(rf"{kind}: network {NUMBER} s.*Tikhonov {NUMBER} s, steps {NUMBER} s, rest {NUMBER} s"))
    for parts in finer:
        if parts and abs(sum(parts) - own) < 0.02:
            return sum(parts)
    return own


def tell_steps(run):
    """{restorer or "": {step: seconds}} of the lines "seconds: restore 1.2, detect 0.3"."""
    steps = {}
    for kind, text in re.findall(r"\]: (?:(\w+): )?seconds: (.+)", run.text):
        pairs = [part.strip().rsplit(" ", 1) for part in text.split(",")]
        steps[kind] = {name: float(seconds) for name, seconds in pairs}
    return steps


def found(run_text, kind):
    """Number of sources, by the log."""
    match = re.search(rf"\]: {kind}: (\d+) sources", run_text)
    if match is None:
        raise Failed(f"the log does not tell how many sources {kind} has")
    return int(match.group(1))
