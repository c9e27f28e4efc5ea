// Reads the house.glb that formats/house_glb.py writes: a node per item, plain arrays, own pictures.

const ARRAYS = { 5121: Uint8Array, 5123: Uint16Array, 5125: Uint32Array, 5126: Float32Array };
const WIDTHS = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4 };

// {items: [{instance, room, kind, class, name, surfaces: [{positions, normals, uvs, indices, material}]}],
//  materials: [{colour, alpha, cutout, texture}], pictures: [() => Promise<ImageBitmap>]}
export function houseOf(data) {
  const view = new DataView(data);
  if (view.getUint32(0, true) !== 0x46546c67) throw new Error("not a GLB file");
  const length = view.getUint32(12, true);
  const gltf = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 20, length)));
  const start = 28 + length; // of the binary chunk's bytes
  const bytes = (k) => {
    const part = gltf.bufferViews[k];
    return [start + (part.byteOffset ?? 0), part.byteLength];
  };
  const array = (k) => {
    if (k === undefined) return null;
    const accessor = gltf.accessors[k];
    const [offset] = bytes(accessor.bufferView);
    return new ARRAYS[accessor.componentType](data, offset + (accessor.byteOffset ?? 0), accessor.count * WIDTHS[accessor.type]);
  };
  const surfaceOf = (p) => ({
    positions: array(p.attributes.POSITION),
    normals: array(p.attributes.NORMAL),
    uvs: array(p.attributes.TEXCOORD_0),
    indices: array(p.indices),
    material: p.material ?? 0,
  });
  const items = (gltf.nodes ?? []).map((node) => ({
    ...(node.extras ?? {}),
    surfaces: node.mesh === undefined ? [] : gltf.meshes[node.mesh].primitives.filter((p) => p.indices !== undefined).map(surfaceOf),
  }));
  const materials = (gltf.materials ?? []).map((m) => {
    const pbr = m.pbrMetallicRoughness ?? {};
    const [r, g, b, alpha] = pbr.baseColorFactor ?? [1, 1, 1, 1];
    return {
      colour: [r, g, b],
      alpha: m.alphaMode === "BLEND" ? alpha : 1,
      cutout: m.alphaMode === "MASK",
      texture: pbr.baseColorTexture ? gltf.textures[pbr.baseColorTexture.index].source : -1,
    };
  });
  const pictures = (gltf.images ?? []).map((image) => () => {
    const [offset, size] = bytes(image.bufferView);
    return createImageBitmap(new Blob([new Uint8Array(data, offset, size)], { type: image.mimeType }), { colorSpaceConversion: "none" });
  });
  return { items, materials, pictures };
}
