"""Render an exported scene with Blender's Cycles; benchmarks/renderers/cycles.py runs it in another Python.

`bpy` is GPL, so this is a separate program: it imports nothing of pbrs_farm and nothing imports it. Both sides share
files: scene.npz, scene.json, dome.exr, textures as PNG. For each job of jobs.json it renders a picture (float32 EXR,
linear) and prints a line of JSON with the CPU time of all threads.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import bpy  # type: ignore[import-not-found]
import numpy as np
from mathutils import Matrix, Vector  # type: ignore[import-not-found]

SURFACE, MIRROR, GLASS, NULL = 0, 1, 2, 3
DIFFUSE = "ShaderNodeBsdfDiffuse"

BLENDER_FROM_WORLD = Matrix(((1, 0, 0, 0), (0, 0, -1, 0), (0, 1, 0, 0), (0, 0, 0, 1)))
"""The exported world has +y up, Blender's +z."""


def main(folder: Path) -> None:
    """Load the scene in folder and render its jobs."""
    described = json.loads((folder / "scene.json").read_text())
    bpy.ops.wm.read_factory_settings(use_empty=True)
    add_mesh(folder, described)
    add_sky(folder, described["sun"])
    portals = [add_portal(portal) for portal in described["portals"]]
    scene = bpy.context.scene
    for job in json.loads((folder / "jobs.json").read_text()):
        set_up(scene, job)
        for portal in portals:
            portal.hide_render = not job["portals"]
        scene.camera = camera_of(job["camera"])
        scene.render.filepath = str(folder / job["file"])
        began, began_wall = time.process_time(), time.perf_counter()
        bpy.ops.render.render(write_still=True)
        spent = {"cpu_s": time.process_time() - began, "wall_s": time.perf_counter() - began_wall}
        print(
            json.dumps({"cycles": bpy.app.version_string, "file": job["file"], **spent}), flush=True
        )


def set_up(scene, job):  # type: ignore[no-untyped-def]
    """Set Cycles' defaults without clamping, denoising and filters."""
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = job["size"]
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_mode = "RGB"
    scene.render.image_settings.color_depth = "32"
    scene.render.image_settings.exr_codec = "ZIP"
    scene.render.film_transparent = False
    scene.render.use_persistent_data = True  # keep the scene loaded between pictures
    c = scene.cycles
    c.device = "CPU"
    c.samples, c.seed = job["samples"], job["seed"]
    c.use_adaptive_sampling = c.use_denoising = c.use_auto_tile = False
    c.sample_clamp_direct = c.sample_clamp_indirect = 0.0
    c.blur_glossy = 0.0
    c.light_sampling_threshold = 0.0
    c.caustics_reflective = c.caustics_refractive = True
    # Path segments: the camera's, one a bounce, the shadow ray.
    bounces = job["max_depth"] - 2
    c.max_bounces = c.diffuse_bounces = c.glossy_bounces = c.transmission_bounces = bounces
    c.transparent_max_bounces = 64
    c.pixel_filter_type = "BOX"
    c.use_light_tree, c.use_guiding = True, False


def camera_of(job):  # type: ignore[no-untyped-def]
    """The camera at the exported pose (OpenGL axes, like Blender's)."""
    camera = bpy.data.objects.get("camera")
    if camera is None:
        camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
        bpy.context.scene.collection.objects.link(camera)
    camera.data.sensor_fit = "HORIZONTAL"
    camera.data.angle = job["hfov_rad"]
    camera.data.clip_start, camera.data.clip_end = 1e-3, 1e4
    camera.matrix_world = BLENDER_FROM_WORLD @ Matrix(job["world_from_camera"])
    return camera


def add_mesh(folder: Path, described) -> None:  # type: ignore[no-untyped-def]
    """One mesh of all triangles, a material a part, with the exported shading normals."""
    arrays = np.load(folder / "scene.npz")
    turn = np.array(BLENDER_FROM_WORLD)[:3, :3].astype(np.float32)
    positions, faces = arrays["positions"] @ turn.T, arrays["faces"]
    mesh = bpy.data.meshes.new("house")
    mesh.vertices.add(len(positions))
    mesh.vertices.foreach_set("co", np.ascontiguousarray(positions, np.float32).ravel())
    mesh.loops.add(3 * len(faces))
    mesh.loops.foreach_set("vertex_index", faces.astype(np.int32).ravel())
    mesh.polygons.add(len(faces))
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * len(faces), 3, dtype=np.int32))
    for part in described["parts"]:
        mesh.materials.append(material_of(folder, part))
    mesh.polygons.foreach_set("material_index", arrays["face_part"].astype(np.int32))
    mesh.uv_layers.new(name="uv").data.foreach_set("uv", arrays["uvs"].astype(np.float32).ravel())
    mesh.update()
    mesh.normals_split_custom_set((arrays["normals"].reshape(-1, 3) @ turn.T).tolist())
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("house", mesh))


def add_sky(folder: Path, sun) -> None:  # type: ignore[no-untyped-def]
    """The dome as the world's picture, the sun as a lamp of the same disc and irradiance."""
    world = bpy.data.worlds.new("sky")
    world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    nodes.clear()
    picture = nodes.new("ShaderNodeTexEnvironment")
    picture.image = bpy.data.images.load(str(folder / "dome.exr"))
    picture.image.colorspace_settings.name = "Linear Rec.709"
    background, out = nodes.new("ShaderNodeBackground"), nodes.new("ShaderNodeOutputWorld")
    links.new(picture.outputs["Color"], background.inputs["Color"])
    links.new(background.outputs["Background"], out.inputs["Surface"])
    bpy.context.scene.world = world
    irradiance = max(sun["irradiance"])
    if irradiance > 0:
        light = bpy.data.lights.new("sun", "SUN")
        light.energy, light.angle = irradiance, 2 * sun["half_angle_rad"]
        light.color = [v / irradiance for v in sun["irradiance"]]
        sun_object = bpy.data.objects.new("sun", light)
        towards = BLENDER_FROM_WORLD.to_3x3() @ Vector(sun["direction"])
        sun_object.rotation_euler = towards.to_track_quat("Z", "Y").to_euler()
        bpy.context.scene.collection.objects.link(sun_object)


def add_portal(portal):  # type: ignore[no-untyped-def]
    """A portal in an opening, facing the room."""
    light = bpy.data.lights.new("portal", "AREA")
    light.cycles.is_portal = True
    corners = [BLENDER_FROM_WORLD.to_3x3() @ Vector(c) for c in portal["corners"]]
    along, up = corners[1] - corners[0], corners[3] - corners[0]
    light.shape, light.size, light.size_y = "RECTANGLE", along.length, up.length
    # An area lamp looks along its own -z.
    x, z = along.normalized(), -(BLENDER_FROM_WORLD.to_3x3() @ Vector(portal["inwards"]))
    axes = Matrix((x, z.cross(x), z)).transposed().to_4x4()
    axes.translation = (corners[0] + corners[2]) / 2
    portal_object = bpy.data.objects.new("portal", light)
    portal_object.matrix_world = axes
    bpy.context.scene.collection.objects.link(portal_object)
    return portal_object


def material_of(folder: Path, part):  # type: ignore[no-untyped-def]
    """One exported material row in Cycles' nodes."""
    material = bpy.data.materials.new(part["name"])
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    nodes, links = tree.nodes, tree.links
    picture = None
    if part["texture"]:
        picture = nodes.new("ShaderNodeTexImage")
        path = str(folder / f"{part['texture']}.png")
        picture.image = bpy.data.images.load(path, check_existing=True)
        picture.image.alpha_mode = "CHANNEL_PACKED"

    def colour(node, rgb):  # type: ignore[no-untyped-def]
        """Set a colour, multiplied by the texture if there is one."""
        if picture is None:
            node.inputs["Color"].default_value = (*rgb, 1)
            return node
        product = nodes.new("ShaderNodeVectorMath")
        product.operation = "MULTIPLY"
        links.new(picture.outputs["Color"], product.inputs[0])
        product.inputs[1].default_value = rgb
        clamped = nodes.new("ShaderNodeVectorMath")
        clamped.operation = "MINIMUM"
        clamped.inputs[1].default_value = 3 * [part["max_kd"] if node.bl_idname == DIFFUSE else 1.0]
        links.new(product.outputs[0], clamped.inputs[0])
        links.new(clamped.outputs[0], node.inputs["Color"])
        return node

    def both(a, b):  # type: ignore[no-untyped-def]
        node = nodes.new("ShaderNodeAddShader")
        links.new(a.outputs[0], node.inputs[0])
        links.new(b.outputs[0], node.inputs[1])
        return node

    if part["kind"] == MIRROR:
        shader = _glossy(nodes, part["f0"])
    elif part["kind"] == GLASS:
        clear = colour(nodes.new("ShaderNodeBsdfTransparent"), part["tau"])
        shader = _mixed(nodes, links, _pane_fresnel(nodes, links), clear, _glossy(nodes, [1, 1, 1]))
    elif part["kind"] == NULL:
        shader = nodes.new("ShaderNodeBsdfTransparent")
    else:
        shader = colour(nodes.new(DIFFUSE), part["kd"])
    if part["kind"] == SURFACE and max(part["tau"]) > 0:
        shader = both(shader, colour(nodes.new("ShaderNodeBsdfTranslucent"), part["tau"]))
    if max(part["radiance"]) > 0:
        shine = nodes.new("ShaderNodeEmission")
        strength = max(part["radiance"])
        shine.inputs["Color"].default_value = (*[v / strength for v in part["radiance"]], 1)
        shine.inputs["Strength"].default_value = strength
        shader = both(shader, shine)
    if picture is not None and part["cutout"]:
        solid = nodes.new("ShaderNodeMath")
        solid.operation = "GREATER_THAN"
        solid.inputs[1].default_value = 0.5
        links.new(picture.outputs["Alpha"], solid.inputs[0])
        shader = _mixed(nodes, links, solid, nodes.new("ShaderNodeBsdfTransparent"), shader)
    out = nodes.new("ShaderNodeOutputMaterial")
    links.new(shader.outputs[0], out.inputs["Surface"])
    return material


def _glossy(nodes, rgb):  # type: ignore[no-untyped-def]
    node = nodes.new("ShaderNodeBsdfGlossy")
    node.distribution = "GGX"
    node.inputs["Color"].default_value = (*rgb, 1)
    node.inputs["Roughness"].default_value = 0.0
    return node


def _mixed(nodes, links, share, a, b):  # type: ignore[no-untyped-def]
    """(1 - share) a + share b."""
    node = nodes.new("ShaderNodeMixShader")
    links.new(share.outputs[0], node.inputs[0])
    links.new(a.outputs[0], node.inputs[1])
    links.new(b.outputs[0], node.inputs[2])
    return node


def _pane_fresnel(nodes, links):  # type: ignore[no-untyped-def]
    """Reflectance of a thin pane of index 1.5 from either side: 2 r / (1 + r)."""
    # The Fresnel node inverts its index on back faces; 1 / 1.5 there undoes it.
    side, index = nodes.new("ShaderNodeNewGeometry"), nodes.new("ShaderNodeMapRange")
    index.inputs["To Min"].default_value, index.inputs["To Max"].default_value = 1.5, 1 / 1.5
    links.new(side.outputs["Backfacing"], index.inputs["Value"])
    fresnel = nodes.new("ShaderNodeFresnel")
    links.new(index.outputs[0], fresnel.inputs["IOR"])
    twice, one_plus, share = (nodes.new("ShaderNodeMath") for _k in range(3))
    twice.operation, one_plus.operation, share.operation = "MULTIPLY", "ADD", "DIVIDE"
    twice.inputs[1].default_value = 2.0
    one_plus.inputs[1].default_value = 1.0
    links.new(fresnel.outputs[0], twice.inputs[0])
    links.new(fresnel.outputs[0], one_plus.inputs[0])
    links.new(twice.outputs[0], share.inputs[0])
    links.new(one_plus.outputs[0], share.inputs[1])
    return share


if __name__ == "__main__":
    main(Path(sys.argv[1]))
