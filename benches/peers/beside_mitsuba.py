#!/usr/bin/env python3
"""Time to a given error beside Mitsuba 3, on the same machine and in turns.

    pip install mitsuba numpy
    benches/peers/beside_mitsuba.py GSII SCENE.glb REFERENCE.exr [SECOND_HALF.exr] > times.csv

SCENE is purely Lambertian (metallic 0, no coat, no glass; textures may be), so that both programs solve the same problem, and seen by
its first camera. REFERENCE is a converged image of it by a third party (Mitsuba's own will do) and fixes the image's size; with a
second, independent half of it, its own noise drops out of the errors: relMSE is then the mean of (a - r1) (a - r2) / (r^2 + 0.01 mean(r)^2).

Mitsuba renders with its vectorised LLVM variant (MI_VARIANT for another), the `path` integrator without a limit of depth and the
sampler named in MI_SAMPLER; the time is that of `mi.render` once its kernels are compiled. gsii's is `seconds.total` less
`seconds.load` and `seconds.write`. A line a run: program, setting, seconds, relMSE, relative difference of the means. At the end the seconds to
1e-2 and 1e-3, between the runs by the straight line in logarithms.
"""

import json
import math
import os
import struct
import subprocess
import sys
import tempfile
import time

import mitsuba as mi
import numpy as np

mi.set_variant(os.environ.get("MI_VARIANT", "llvm_ad_rgb"))

SAMPLER = os.environ.get("MI_SAMPLER", "independent")
TRIALS = [16, 64, 256]
ERRORS = {"gsii": [0.2, 0.1, 0.05, 0.025], "mcpt": [0.4, 0.2, 0.1, 0.05]}
MOST_TRIALS = 4096
TARGETS = [1e-2, 1e-3]
COMPONENTS = {5121: "<u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


class Glb:
    """A binary glTF file: its document, accessors and images."""

    def __init__(self, path):
        data = open(path, "rb").read()
        length = struct.unpack_from("<I", data, 12)[0]
        self.doc = json.loads(data[20 : 20 + length])
        self.binary = data[28 + length :]

    def view(self, number):
        view = self.doc["bufferViews"][number]
        start = view.get("byteOffset", 0)
        return self.binary[start : start + view["byteLength"]]

    def accessor(self, number):
        a = self.doc["accessors"][number]
        kind, width = np.dtype(COMPONENTS[a["componentType"]]), WIDTHS[a["type"]]
        stride = self.doc["bufferViews"][a["bufferView"]].get("byteStride", 0)
        if stride not in (0, width * kind.itemsize):
            sys.exit("interleaved accessors are not read here")
        numbers = np.frombuffer(self.view(a["bufferView"]), kind, a["count"] * width, a.get("byteOffset", 0))
        return numbers.reshape(-1, width)

    def nodes(self):
        """All nodes of the default scene with their matrices."""
        roots = self.doc["scenes"][self.doc.get("scene", 0)]["nodes"]
        stack = [(n, np.eye(4)) for n in reversed(roots)]
        while stack:
            number, parent = stack.pop()
            node = self.doc["nodes"][number]
            matrix = parent @ local_matrix(node)
            yield node, matrix
            stack += [(c, matrix) for c in reversed(node.get("children", []))]


def local_matrix(node):
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    x, y, z, w = node.get("rotation", [0, 0, 0, 1])
    rotation = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])
    matrix = np.eye(4)
    matrix[:3, :3] = rotation * np.array(node.get("scale", [1, 1, 1]))
    matrix[:3, 3] = node.get("translation", [0, 0, 0])
    return matrix


def parts(glb):
    """Triangles in world space: by material and attributes, as few meshes as possible, which suits Mitsuba best."""
    by = {}
    for node, matrix in glb.nodes():
        if "mesh" not in node:
            continue
        linear = matrix[:3, :3]
        for primitive in glb.doc["meshes"][node["mesh"]]["primitives"]:
            attributes = primitive["attributes"]
            at = glb.accessor(attributes["POSITION"]) @ linear.T + matrix[:3, 3]
            faces = np.arange(len(at)) if "indices" not in primitive else glb.accessor(primitive["indices"]).ravel()
            faces = faces.reshape(-1, 3).astype(np.int64)
            if np.linalg.det(linear) < 0:
                faces = faces[:, ::-1]
            normals = uvs = None
            if "NORMAL" in attributes:
                normals = glb.accessor(attributes["NORMAL"]) @ np.linalg.inv(linear)
                normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
            if "TEXCOORD_0" in attributes:
                uvs = glb.accessor(attributes["TEXCOORD_0"])
            key = (primitive["material"], normals is not None, uvs is not None)
            by.setdefault(key, []).append((at, faces, normals, uvs))
    return by


def write_mesh(path, name, pieces):
    starts = np.cumsum([0] + [len(at) for at, *_ in pieces])
    joined = lambda k: np.concatenate([piece[k] for piece in pieces])
    faces = np.concatenate([faces + start for (_, faces, *_), start in zip(pieces, starts)])
    has = [pieces[0][k] is not None for k in (2, 3)]
    mesh = mi.Mesh(name, int(starts[-1]), len(faces), has_vertex_normals=has[0], has_vertex_texcoords=has[1])
    values = mi.traverse(mesh)
    values["vertex_positions"] = mi.Float(joined(0).astype(np.float32).ravel())
    values["faces"] = mi.UInt32(faces.astype(np.uint32).ravel())
    if has[0]:
        values["vertex_normals"] = mi.Float(joined(2).astype(np.float32).ravel())
    if has[1]:
        values["vertex_texcoords"] = mi.Float(joined(3).astype(np.float32).ravel())
    values.update()
    mesh.write_ply(path)


def reflectance(glb, material, has_uvs, folder):
    pbr = material.get("pbrMetallicRoughness", {})
    factor = pbr.get("baseColorFactor", [1, 1, 1, 1])[:3]
    slot = pbr.get("baseColorTexture")
    if slot is None or not has_uvs:
        return {"type": "rgb", "value": factor}
    texture = glb.doc["textures"][slot["index"]]
    if slot.get("texCoord", 0) or "extensions" in slot:
        sys.exit("transformed textures and second texture coordinates are not read here")
    image = glb.doc["images"][texture["source"]]
    path = os.path.join(folder, f"image{texture['source']}.{image['mimeType'].split('/')[1]}")
    with open(path, "wb") as file:
        file.write(glb.view(image["bufferView"]))
    # Mitsuba has no product of a texture and a colour.
    product = (pixels(path) * factor).astype(np.float32)
    return {"type": "bitmap", "bitmap": mi.Bitmap(product), "raw": True}


def mitsuba_scene(glb, size, folder):
    scene = {"type": "scene", "integrator": {"type": "path", "max_depth": -1}}
    for number, ((material, has_normals, has_uvs), pieces) in enumerate(parts(glb).items()):
        path = os.path.join(folder, f"{number}.ply")
        write_mesh(path, f"part{number}", pieces)
        material = glb.doc["materials"][material]
        diffuse = {"type": "diffuse", "reflectance": reflectance(glb, material, has_uvs, folder)}
        shape = {"type": "ply", "filename": path, "face_normals": not has_normals}
        strength = material.get("extensions", {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1)
        emitted = [strength * e for e in material.get("emissiveFactor", [0, 0, 0])]
        if any(emitted):
            if material.get("doubleSided", False):
                sys.exit("light sources that shine to both sides are not known to Mitsuba")
            shape["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": emitted}}
            shape["bsdf"] = diffuse
        else:
            shape["bsdf"] = {"type": "twosided", "inside": diffuse}
        scene[f"part{number}"] = shape
    node, matrix = next(((n, m) for n, m in glb.nodes() if "camera" in n), (None, None))
    if node is None:
        sys.exit("the scene has no camera")
    camera = glb.doc["cameras"][node["camera"]]["perspective"]
    # Cameras look along -z there and along +z here.
    turned = matrix @ np.diag([-1.0, 1.0, -1.0, 1.0])
    film = {"type": "hdrfilm", "width": size[0], "height": size[1], "rfilter": {"type": "box"}}
    scene["sensor"] = {
        "type": "perspective",
        "fov_axis": "y",
        "fov": math.degrees(camera["yfov"]),
        "near_clip": 1e-3,
        "far_clip": 1e5,
        "to_world": mi.ScalarTransform4f(turned),
        "sampler": {"type": SAMPLER},
        "film": film | {"pixel_format": "rgb", "component_format": "float32"},
    }
    return mi.load_dict(scene)


def pixels(path):
    """Linear RGB of an image file, whose other layers do not matter."""
    layers = dict(mi.Bitmap(path).split())
    bitmap = layers["<root>"].convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, srgb_gamma=False)
    return np.array(bitmap, float)


class Reference:
    """A converged image in two halves, perhaps the same."""

    def __init__(self, paths):
        self.halves = [pixels(p) for p in (paths * 2)[:2]]
        mean = (self.halves[0] + self.halves[1]) / 2
        self.mean = mean.mean()
        self.weight = 1 / (mean**2 + 0.01 * self.mean**2)
        self.size = [mean.shape[1], mean.shape[0]]

    def report(self, program, setting, seconds, image):
        error = float((self.weight * (image - self.halves[0]) * (image - self.halves[1])).mean())
        print(f"{program},{setting},{seconds:.3f},{error:.4e},{image.mean() / self.mean - 1:+.5f}", flush=True)
        return seconds, error


def run_mitsuba(scene, reference):
    runs = []
    for trials in TRIALS:
        # Twice: the first run of a number of trials may still compile.
        for seed in range(2):
            start = time.perf_counter()
            image = np.array(mi.render(scene, spp=trials, seed=seed), float)
            seconds = time.perf_counter() - start
        runs.append(reference.report("mitsuba", trials, seconds, image))
    return runs


def run_gsii(gsii, path, method, reference, folder):
    runs = []
    for error in ERRORS[method]:
        image, stats = os.path.join(folder, "image.exr"), os.path.join(folder, "stats.json")
        size = ["--width", str(reference.size[0]), "--height", str(reference.size[1])]
        limits = ["--error", str(error), "--max-trials", str(MOST_TRIALS), "--measure-bias", "0", "--layers", "hires"]
        subprocess.run(
            [gsii, "render", path, "-q", "--method", method, *size, *limits, "-o", image, "--stats", stats], check=True
        )
        seconds = json.load(open(stats))["seconds"]
        spent = seconds["total"] - seconds["load"] - seconds["write"]
        runs.append(reference.report(method, error, spent, pixels(image)))
    return runs


def seconds_to(target, runs):
    """Where the line through the runs on both sides of the target crosses it; beyond the last run with time times error held."""
    for (t0, e0), (t1, e1) in zip(runs, runs[1:]):
        if e0 > target >= e1:
            share = math.log(e0 / target) / math.log(e0 / e1)
            return f"{math.exp(math.log(t0) + share * math.log(t1 / t0)):.2f}"
    time, error = runs[-1] if runs[-1][1] > target else runs[0]
    return f"{time * error / target:.1f} (extrapolated)" if error > target else f"under {time:.2f}"


def main():
    if len(sys.argv) not in (4, 5):
        sys.exit(__doc__)
    gsii, path, *references = sys.argv[1:]
    reference = Reference(references)
    glb = Glb(path)
    print("program,setting,seconds,relMSE,mean")
    results = {}
    with tempfile.TemporaryDirectory() as folder:
        scene = mitsuba_scene(glb, reference.size, folder)
        mi.render(scene, spp=4)
        for method in ERRORS:
            results[method] = run_gsii(gsii, path, method, reference, folder)
        results["mitsuba"] = run_mitsuba(scene, reference)
    for target in TARGETS:
        for program, runs in results.items():
            print(f"# {program} to {target}: {seconds_to(target, runs)} s")


if __name__ == "__main__":
    main()
