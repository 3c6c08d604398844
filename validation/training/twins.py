#!/usr/bin/env python3
"""Twins of rextract-train in PyTorch, many trainings at a time on one GPU: networks, optics and losses as there, images made by
its generators (twins.c), so that what takes days on two cores takes minutes. twins.sh calls it.

    twins.py check FOLDER MODE LOSS GRADIENTS IMAGE    one image's terms of the loss and gradients beside the trainer's
    twins.py train FOLDER SECONDS                      all that trainings() names, from FOLDER/SEED.images, test.images and
                                                       first/; parameters and log.json into FOLDER/trained

Each training takes a batch of 32 images in turn; those of one seed that do not learn actively take the same ones. What differs
from the trainer: batches of 32 for 8, from a fixed set of images of which each is seen two or three times, turned anew; with
active learning bins are drawn with chances in proportion to their list (Eq. 4); for CLIP_IMAGE no image's gradient by the output
of a network is above twice the batch's median; networks run in bfloat16 but for their last convolution; the parameters are those
at the end, not of the best epoch. Needs torch (for `train` a GPU with 40 GB) and numpy."""
import json
import math
import sys
import time
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F

GPU = torch.cuda.is_available()
DEVICE = "cuda" if GPU else "cpu"
INSIDE = torch.bfloat16 if GPU else torch.float32  # of a network
if GPU:
    torch.backends.cuda.matmul.allow_tf32 = torch.backends.cudnn.allow_tf32 = torch.backends.cudnn.benchmark = True

SIDE, KERNEL, MARGIN, META, BINS = 128, 63, 12, 16, 25  # of images, of stamps of K', of the border without loss; twins.c; the grid
RECORD = META + 4 * SIDE * SIDE + KERNEL * KERNEL
SEEDS, BATCH, RATE, WARMUP, FLOOR, TIKHONOV, TARGET = (1, 2, 3), 32, 0.002, 0.04, 3.0, 0.1, 2.0
FWHM_OF_SIGMA = 2.3548200450309493


# --- networks: nodes and parameters in the order of src/nn/psfnet.c and net.h

def network(inputs, blocks, decoder="BILINEAR", width=8):
    """Its nodes, and the number of its parameters."""
    nodes = [{"op": "INPUT", "channels": inputs}]

    def put(op, source, channels, add=-1, relu=0, kernel=0, stride=1):
        nodes.append({"op": op, "source": source, "channels": channels, "add": add, "relu": relu, "kernel": kernel, "stride": stride})
        return len(nodes) - 1

    def residual(source, channels):
        return put("CONV", put("CONV", source, channels, relu=1, kernel=3), channels, add=source, kernel=3)

    skip = put("CONV", put("UNSHUFFLE", 0, 4 * inputs), 2 * width, relu=1, kernel=3)
    trunk = put("CONV", skip, 4 * width, relu=1, kernel=3, stride=2)
    for _ in range(blocks):
        trunk = residual(trunk, 4 * width)
    if decoder == "BILINEAR":
        half = put("UP2", put("CONV", trunk, 2 * width, kernel=1), 2 * width, add=skip, relu=1)
        put("UPCONV", residual(half, 2 * width), 1, kernel=3)
    else:
        half = put("SHUFFLE", put("CONV", trunk, 8 * width, kernel=3), 2 * width, add=skip, relu=1)
        put("SHUFFLE", put("CONV", residual(half, 2 * width), 4, kernel=3), 1)
    at = 0
    for node in nodes:
        if node["op"] in ("CONV", "UPCONV"):
            node["inputs"] = nodes[node["source"]]["channels"]
            node["weight"], node["bias"] = at, at + node["inputs"] * node["channels"] * node["kernel"] ** 2
            at = node["bias"] + node["channels"]
    return nodes, at


def first_parameters(net, seed):
    """As rx_net_initialise() has them, of other random numbers: for networks that the trainer does not have."""
    nodes, n = net
    values, rng = np.zeros(n, np.float32), np.random.default_rng(seed)
    last = max(i for i, node in enumerate(nodes) if "weight" in node)
    for i, node in enumerate(nodes):
        if "weight" in node:
            damped = (0.3 if node["op"] == "CONV" and node["add"] >= 0 else 1) * (0.1 if i == last else 1)
            sigma = damped * math.sqrt(2 / (node["inputs"] * node["kernel"] ** 2))
            values[node["weight"]:node["bias"]] = sigma * rng.standard_normal(node["bias"] - node["weight"])
    return values


def shares():
    """[d][v][r]: share of the lower row y + r - 1 in the upper row 2 y + d + v - 1 (nn/layers.h)."""
    a = torch.zeros(2, 3, 3)
    rows = {-1: ((0, 0.75), (1, 0.25)), 0: ((0, 0.25), (1, 0.75)), 1: ((1, 0.75), (2, 0.25)), 2: ((1, 0.25), (2, 0.75))}
    for d in range(2):
        for v in range(3):
            for r, share in rows[d + v - 1]:
                a[d, v, r] += share
    return a.to(DEVICE)


SHARES = shares()


def doubled(x, dim):
    n = x.shape[dim]
    before = torch.cat([x.narrow(dim, 0, 1), x.narrow(dim, 0, n - 1)], dim)
    after = torch.cat([x.narrow(dim, 1, n - 1), x.narrow(dim, n - 1, 1)], dim)
    return torch.stack([0.25 * before + 0.75 * x, 0.75 * x + 0.25 * after], dim + 1).flatten(dim, dim + 1)


def shuffle(x):
    b, c, h, w = x.shape
    return x.view(b, 2, 2, c // 4, h, w).permute(0, 3, 4, 1, 5, 2).reshape(b, c // 4, 2 * h, 2 * w)


def unshuffle(x):
    b, c, h, w = x.shape
    return x.view(b, c, h // 2, 2, w // 2, 2).permute(0, 3, 5, 1, 2, 4).reshape(b, 4 * c, h // 2, w // 2)


def laid(x):
    return x.contiguous(memory_format=torch.channels_last) if GPU else x


def run(net, parameters, planes):
    nodes = net[0]
    out, last = [torch.cat(planes, 1)], max(i for i, node in enumerate(nodes) if "weight" in node)
    for i, node in enumerate(nodes[1:], 1):
        y = out[node["source"]]
        if node["op"] == "UNSHUFFLE":
            y = laid(unshuffle(y).to(INSIDE))
        elif node["op"] == "SHUFFLE":
            y = shuffle(y)
        elif node["op"] == "UP2":
            y = doubled(doubled(y, 2), 3)
        else:
            kind = torch.float32 if i == last else INSIDE
            y = y.to(kind)
            weight = parameters[node["weight"]:node["bias"]].to(kind).view(node["channels"], node["inputs"], node["kernel"], node["kernel"])
            bias = parameters[node["bias"]:node["bias"] + node["channels"]].to(kind)
            if node["op"] == "UPCONV":
                folded = torch.einsum("avr,bus,oivu->aboirs", SHARES, SHARES, weight).reshape(4 * node["channels"], node["inputs"], 3, 3)
                y = shuffle(F.conv2d(laid(y), laid(folded), bias.repeat(4), padding=1))
            else:
                y = F.conv2d(laid(y), laid(weight), bias, stride=node["stride"], padding=node["kernel"] // 2)
        if node["add"] >= 0:
            y = y + out[node["add"]]
        out.append(F.relu(y) if node["relu"] else y)
    return out[-1].float()


# --- what stands around them: nn/front.h, nn/deblur.h, nn/rl_step.h

def stretch(v):
    return torch.sign(v) * (torch.sqrt(v.abs() + 0.25) - 0.5)


def unstretch(u):
    return torch.sign(u) * (u * u + u.abs())


def gauss(fwhm, radius):
    unit = FWHM_OF_SIGMA / (fwhm * math.sqrt(2))
    whole = 2 * math.erf((radius + 0.5) * unit)
    return np.array([(math.erf((i + 0.5) * unit) - math.erf((i - 0.5) * unit)) / whole for i in range(-radius, radius + 1)], np.float32)


def target_spectrum(n):
    line = np.zeros(n)
    for i, g in enumerate(gauss(TARGET, 8), -8):
        line[i % n] += g
    wave = np.fft.fft(line).real
    return torch.tensor(np.outer(wave, wave[:n // 2 + 1]).astype(np.float32), device=DEVICE)


TARGETS = {SIDE: target_spectrum(SIDE)}


def spectrum(stamp, n=SIDE):
    size = stamp.shape[-1]
    return torch.fft.rfft2(torch.roll(F.pad(stamp, (0, n - size, 0, n - size)), (-(size // 2),) * 2, (-2, -1)))


def convolve(k, f):
    return torch.fft.irfft2(torch.fft.rfft2(f) * k, s=f.shape[-2:])


def correlate(k, f):
    return convolve(k.conj(), f)


def tikhonov(k, x):
    target = TARGETS[x.shape[-1]]
    optics = k * target
    return convolve((1 + TIKHONOV) * target * optics.conj() / (optics.abs() ** 2 + TIKHONOV), x)


def rl_step(f, x, image, inside):
    model = convolve(image["k"], f.clamp(min=0)) + 1
    ratio = (x + 1) / model.clamp(min=0.25)
    if inside is None:
        share = image["k_sum"].expand_as(f)
    else:
        ratio, share = ratio * inside, correlate(image["k"], inside)
    enough = share >= 0.02
    gain = (correlate(image["k"], ratio) / torch.where(enough, share, torch.ones_like(share))).clamp(0.25, 4)
    return torch.where((f > 0) & enough, f * gain, f)


# --- the loss: train/loss.h, train/step.h

def band(n, normal):
    """The Gaussian of the loss as a matrix for one axis of n pixels; normal: its rows sum to 1."""
    matrix = np.zeros((n, n), np.float32)
    for k, g in enumerate(gauss(1.5 * FWHM_OF_SIGMA, 8), -8):
        matrix += g * np.eye(n, k=k, dtype=np.float32)
    return torch.tensor(matrix / matrix.sum(1, keepdims=True) if normal else matrix, device=DEVICE)


SMOOTH, LIGHT = band(SIDE, True), band(SIDE - 2 * MARGIN, False)


def weights(x):
    brightness = F.max_pool2d(SMOOTH @ x.clamp(min=0) @ SMOOTH.T, 7, 1, 3)
    return FLOOR ** 2 / (FLOOR ** 2 + brightness ** 2)


def inner(v):
    return v[..., MARGIN:-MARGIN, MARGIN:-MARGIN]


def pixels(out, truth, weight):
    return (inner(weight) * inner(out - truth) ** 2).mean((1, 2, 3))


def light(out, truth, weight):
    return (inner(weight) * (LIGHT @ inner(out - truth) @ LIGHT.T) ** 2).mean((1, 2, 3))


def focal(out, truth):
    z = torch.fft.fft2(inner(stretch(out) - stretch(truth)), norm="ortho")
    square = z.real ** 2 + z.imag ** 2
    size = torch.sqrt(square + 1e-20).detach()
    return (size / size.amax((2, 3), keepdim=True) * square).mean((1, 2, 3))


class Held(torch.autograd.Function):
    """Of a batch's gradients none is above twice their median."""

    @staticmethod
    def forward(ctx, x):
        return x.view_as(x)

    @staticmethod
    def backward(ctx, gradient):
        norm = gradient.flatten(1).norm(dim=1)
        most = 2 * norm.sort().values[norm.numel() // 2]
        return gradient * torch.where(norm > most, most / norm, torch.ones_like(norm)).view(-1, 1, 1, 1)


class Training:
    def __init__(self, name, seed, first, mode="INFORMED", both=False, active=False, blocks=2, rl_steps=1, stages=1, of_light=0.0, of_ffl=1.0):
        self.name, self.seed, self.mode, self.both, self.active = name, seed, mode, both, active
        self.rl_steps, self.stages, self.of_light, self.of_ffl = rl_steps, stages, of_light, of_ffl
        decoder = "BILINEAR" if mode == "INFORMED" else "SUBPIXEL"
        self.nets = [network(3 if mode == "INFORMED" else 1, blocks, decoder)]
        begun = [np.fromfile(f"{first}.restore", np.float32)]
        if both:
            self.nets.append(network(2, blocks, decoder))
            begun.append(np.fromfile(f"{first}.psf", np.float32))
        if stages == 2:
            self.nets.append(network(5, blocks, decoder))
            begun.append(first_parameters(self.nets[1], seed))
        for values, (_, n) in zip(begun, self.nets):
            assert len(values) == n, f"{first}: {len(values)} parameters for {n}"
        self.parameters = [torch.tensor(v, device=DEVICE).requires_grad_() for v in begun]
        self.moments = [(torch.zeros_like(p), torch.zeros_like(p)) for p in self.parameters]
        self.sums = torch.zeros(2, device=DEVICE)  # losses, steps
        self.held = True

    def corrected(self, i, planes, base):
        out = run(self.nets[i], self.parameters[i], planes)
        return unstretch((Held.apply(out) if self.held else out) + base)

    def restore(self, image, x, w, inside):
        """What each stage makes of x, the last one last."""
        sx = stretch(x)
        if self.mode == "BLIND":
            return [self.corrected(0, [sx], sx)]
        sw, fwhm = stretch(w), image["channel"].expand_as(x)
        f = self.corrected(0, [sx, sw, fwhm], sw)
        for _ in range(self.rl_steps):
            f = rl_step(f, x, image, inside)
        if self.stages == 1:
            return [f]
        left, sf = x - convolve(image["k"], f.clamp(min=0)), stretch(f)
        second = self.corrected(1, [sx, sw, fwhm, sf, stretch(left)], sf)
        return [f, rl_step(second, x, image, inside)]

    def blur(self, image, y):
        s = stretch(y)
        return self.corrected(1, [s, image["channel"].expand_as(y)], s)

    def terms(self, image):
        """Of each image: pixels, light, FFL, those of the PSF network and its cycles, the first stage's pixels."""
        stages = self.restore(image, image["x"], image["w"], image["inside"])
        out, y, weight = stages[-1], image["y"], image["wx"]
        found = {"idt": pixels(out, y, weight), "light": light(out, y, weight), "ffl": focal(out, y)}
        if self.both:
            blurred = self.blur(image, y)
            w = tikhonov(image["k"], blurred) if self.mode == "INFORMED" else None
            found["idt_psf"] = pixels(blurred, image["x"], image["wy"])
            found["rec"] = pixels(self.restore(image, blurred, w, None)[-1], y, image["wy"])
            found["rec_psf"] = pixels(self.blur(image, out), image["x"], weight)
        if self.stages == 2:
            found["first"] = 0.5 * pixels(stages[0], y, weight)
        return found

    def loss(self, found):
        factors = {"light": self.of_light, "ffl": self.of_ffl}
        return sum(factors.get(name, 1) * value for name, value in found.items()).mean()

    def step(self, image, rate, count):
        loss = self.loss(self.terms(image))
        gradients = torch.autograd.grad(loss, self.parameters)
        norm = torch.sqrt(sum((g * g).sum() for g in gradients))
        scale = torch.where(torch.isfinite(norm), (1 / norm.clamp(min=1e-12)).clamp(max=1), torch.zeros_like(norm))
        with torch.no_grad():
            for p, g, (mean, square) in zip(self.parameters, gradients, self.moments):
                g = torch.nan_to_num(g * scale)
                mean.mul_(0.9).add_(g, alpha=0.1)
                square.mul_(0.99).addcmul_(g, g, value=0.01)
                p.sub_(rate * (mean / (1 - 0.9 ** count)) / (torch.sqrt(square / (1 - 0.99 ** count)) + 1e-8))
            self.sums += torch.stack([loss.detach(), torch.ones_like(loss)])


# --- images

FULL, SHORT = ("x", "w", "y"), ("wx", "wy", "inside")


class Images:
    """All images of a file on the device."""

    def __init__(self, path, most=None):
        n = path.stat().st_size // (4 * RECORD)
        records, self.n = np.memmap(path, np.float32, "r", shape=(n, RECORD)), min(n, most or n)
        self.full = torch.empty(self.n, 3, SIDE, SIDE, device=DEVICE)
        self.short = torch.empty(self.n, 3, SIDE, SIDE, device=DEVICE, dtype=torch.float16 if GPU else torch.float32)
        self.kernel = torch.empty(self.n, 1, KERNEL, KERNEL, device=DEVICE)
        self.fwhm, self.bin = torch.empty(self.n, device=DEVICE), torch.empty(self.n, dtype=torch.long, device=DEVICE)
        for a in range(0, self.n, 256):
            part = torch.tensor(np.array(records[a:min(a + 256, self.n)]), device=DEVICE)
            rows, planes = slice(a, a + len(part)), part[:, META:META + 4 * SIDE * SIDE].view(-1, 4, SIDE, SIDE)
            kernel = part[:, META + 4 * SIDE * SIDE:].view(-1, 1, KERNEL, KERNEL)
            x, y, blurred = planes[:, :1], planes[:, 2:3], planes[:, 3:]
            away = (blurred - convolve(spectrum(kernel), y)).abs()  # light from beyond the patch: train/step_pass.c
            self.short[rows] = torch.cat([weights(x), weights(y), (away <= 0.5 + 0.25 * blurred.abs()).float()], 1)
            self.full[rows], self.kernel[rows], self.bin[rows], self.fwhm[rows] = planes[:, :3], kernel, part[:, 0].long(), part[:, 1]
        self.places = torch.nn.utils.rnn.pad_sequence([torch.nonzero(self.bin == b).flatten() for b in range(BINS)], batch_first=True)
        self.sizes = torch.bincount(self.bin, minlength=BINS)


def room(n):
    """A batch to be filled, in memory that stays where it is."""
    image = {name: torch.zeros(n, 1, SIDE, SIDE, device=DEVICE) for name in FULL + SHORT}
    image["kernel"] = torch.zeros(n, 1, KERNEL, KERNEL, device=DEVICE)
    image["k"], image["k_sum"], image["channel"] = spectrum(image["kernel"]), torch.ones(n, 1, 1, 1, device=DEVICE), torch.zeros(n, 1, 1, 1, device=DEVICE)
    return image


def turned(v, turn):
    v = v.transpose(-1, -2) if turn & 4 else v
    v = v.flip(-1) if turn & 1 else v
    return v.flip(-2) if turn & 2 else v


def fill(image, images, index, turn=0):
    for planes, names in ((images.full, FULL), (images.short, SHORT)):
        part = turned(planes[index], turn)
        for i, name in enumerate(names):
            image[name].copy_(part[:, i:i + 1])
    image["kernel"].copy_(turned(images.kernel[index], turn))
    image["k"].copy_(spectrum(image["kernel"]))
    image["k_sum"].copy_(image["kernel"].sum((-1, -2), keepdim=True))
    image["channel"].copy_(((images.fwhm[index] - 5) / 3).view(-1, 1, 1, 1))
    return image


# --- all trainings at once

def trainings(folder):
    """{full recipe, RESTORE alone} x {ACTIVE, UNIFORM} x {INFORMED, BLIND}, and the supplied network's losses with one stage, twice
    the multiplications, and two stages."""
    for seed in SEEDS:
        for mode in ("INFORMED", "BLIND"):
            for both in (False, True):
                for active in (False, True):
                    name = f"{mode}-{'both' if both else 'alone'}-{'active' if active else 'uniform'}-{seed}".lower()
                    yield Training(name, seed, folder / f"first/{mode.lower()}-{seed}", mode, both, active, blocks=2 if mode == "INFORMED" else 5)
        supplied = {"of_light": 30, "of_ffl": 0.3}
        yield Training(f"deep-{seed}", seed, folder / f"first/deep-{seed}", blocks=6, rl_steps=2, **supplied)
        yield Training(f"stages-{seed}", seed, folder / f"first/stages-{seed}", stages=2, **supplied)
        yield Training(f"base-{seed}", seed, folder / f"first/stages-{seed}", **supplied)


def captured(all_trainings, batch_of, rate, count):
    """The step of each as one graph of kernels; parameters stay as they were."""
    side, graphs, memory = torch.cuda.Stream(), {}, None
    rate.fill_(0)
    count.fill_(1)
    for t in all_trainings:
        kept = [p.detach().clone() for p in t.parameters]
        side.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(side):
            for _ in range(2):
                t.step(batch_of(t), rate, count)
        torch.cuda.current_stream().wait_stream(side)
        graphs[t.name] = torch.cuda.CUDAGraph()
        with torch.cuda.graph(graphs[t.name], pool=memory):
            t.step(batch_of(t), rate, count)
        memory = memory or graphs[t.name].pool()
        with torch.no_grad():
            for p, value, moments in zip(t.parameters, kept, t.moments):
                p.copy_(value)
                moments[0].zero_()
                moments[1].zero_()
        t.sums.zero_()
    return graphs


def losses_of_bins(t, test, index, batch):
    sums, n, size = torch.zeros(BINS, device=DEVICE), torch.zeros(BINS, device=DEVICE), len(batch["channel"])
    with torch.no_grad():
        for a in range(0, len(index) - size + 1, size):
            part = index[a:a + size]
            fill(batch, test, part)
            loss = pixels(t.restore(batch, batch["x"], batch["w"], batch["inside"])[-1], batch["y"], batch["wx"])
            sums.index_add_(0, test.bin[part], loss)
            n.index_add_(0, test.bin[part], torch.ones_like(loss))
    return sums / n


def schedule(progress):
    return progress / WARMUP if progress < WARMUP else 0.5 * (1 + math.cos(math.pi * (progress - WARMUP) / (1 - WARMUP)))


def train(folder, seconds):
    begun, out = time.time(), folder / "trained"
    out.mkdir(exist_ok=True)
    images, test = {seed: Images(folder / f"{seed}.images") for seed in SEEDS}, Images(folder / "test.images")
    everyone, rate, count = list(trainings(folder)), torch.zeros((), device=DEVICE), torch.zeros((), device=DEVICE)
    shared, own, tested = {seed: room(BATCH) for seed in SEEDS}, room(BATCH), room(300)
    for seed in SEEDS:
        fill(shared[seed], images[seed], torch.arange(BATCH, device=DEVICE))
    fill(own, images[SEEDS[0]], torch.arange(BATCH, device=DEVICE))
    graphs = captured(everyone, lambda t: own if t.active else shared[t.seed], rate, count)
    order = {seed: torch.tensor(np.random.default_rng(seed).permutation(images[seed].n), device=DEVICE) for seed in SEEDS}
    chance = {t.name: torch.ones(BINS, device=DEVICE) for t in everyone if t.active}
    seen = {name: torch.zeros(BINS, device=DEVICE) for name in chance}
    random, turns = torch.Generator(device=DEVICE), np.random.default_rng(9).integers(0, 8, 10 ** 6)
    random.manual_seed(1)
    log, done, rounds, timed = [], 0, 5000, 0  # how many rounds there is time for the first sixty say
    while done < rounds:
        torch.cuda.synchronize()
        if done == 30:
            timed = time.time()
        if done == 60:
            rounds = int(60 + (seconds - (time.time() - begun)) / (1.03 * (time.time() - timed) / 30))
        rate.fill_(RATE * schedule((done + 0.5) / rounds))
        count.fill_(done + 1.0)
        for seed in SEEDS:
            at = (torch.arange(BATCH, device=DEVICE) + done * BATCH) % images[seed].n
            fill(shared[seed], images[seed], order[seed][at], int(turns[done]))
        for t in everyone:
            if t.active:
                bins = torch.multinomial(chance[t.name], BATCH, True, generator=random)
                which = torch.rand(BATCH, device=DEVICE, generator=random) * images[t.seed].sizes[bins]
                fill(own, images[t.seed], images[t.seed].places[bins, which.long()], int(turns[7 * done + 3]))
                seen[t.name] += torch.bincount(bins, minlength=BINS)
            graphs[t.name].replay()
            if t.active and done % 40 == 39:
                loss = losses_of_bins(t, test, torch.randperm(test.n, device=DEVICE, generator=random)[:300], tested)
                known = torch.isfinite(loss)
                chance[t.name] = torch.where(known, (loss / (2 * loss[known].median())).clamp(max=1), chance[t.name])
        done += 1
        if done % (rounds // 8) == 0 or done == rounds:
            every = torch.arange(test.n, device=DEVICE)
            log.append({"images": done * BATCH, "seconds": round(time.time() - begun, 1),
                        "test": {t.name: float(losses_of_bins(t, test, every, tested).mean()) for t in everyone},
                        "training": {t.name: float(t.sums[0] / t.sums[1]) for t in everyone}})
            (out / "log.json").write_text(json.dumps(log, indent=1) + "\n", encoding="utf-8")
            print(f"{done * BATCH} of {rounds * BATCH} images each, {time.time() - begun:.0f} s", flush=True)
            for t in everyone:
                t.sums.zero_()
    for t in everyone:
        for part, p in zip(("restore", "psf" if t.both else "second"), t.parameters):
            p.detach().cpu().numpy().tofile(out / f"{t.name}.{part}")
    (out / "images").write_text(f"{rounds * BATCH}\n", encoding="utf-8")
    (out / "seen.json").write_text(json.dumps({name: n.tolist() for name, n in seen.items()}), encoding="utf-8")


def check(folder, mode, loss, gradients, index):
    t = Training("checked", 1, folder / f"first/{mode.lower()}-1", mode, both=True, blocks=2 if mode == "INFORMED" else 5, of_light=30)
    t.held = False
    found = t.terms(fill(room(1), Images(folder / "1.images", index + 1), torch.tensor([index])))
    own = torch.autograd.grad(t.loss(found), t.parameters)
    pairs = list(zip((float(v) for v in found.values()), (float(word) for word in loss.read_text(encoding="utf-8").split())))
    worst = [abs(a / b - 1) for a, b in pairs]
    for part, gradient in zip(("restore", "psf"), own):
        its = np.fromfile(f"{gradients}.{part}", np.float32)
        worst.append(float(np.linalg.norm(gradient.numpy() - its) / np.linalg.norm(its)))
    print(f"{mode}, image {index}: terms and gradients within {max(worst):.1e} of the trainer's")
    return max(worst) < 1e-4


if __name__ == "__main__":
    if len(sys.argv) == 4 and sys.argv[1] == "train":
        if not GPU:
            sys.exit("twins.py: no GPU that torch can use; see twins.sh")
        train(Path(sys.argv[2]), float(sys.argv[3]))
    elif len(sys.argv) == 7 and sys.argv[1] == "check":
        sys.exit(not check(Path(sys.argv[2]), sys.argv[3], Path(sys.argv[4]), sys.argv[5], int(sys.argv[6])))
    else:
        sys.exit(__doc__)
