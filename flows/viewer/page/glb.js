// Binary glTF as facade_core/export/glb.py writes it: unlit triangles, one JPEG for each material, values padded to four bytes.

const JSON_CHUNK_AT = 12;
const KINDS = { 5123: Uint16Array, 5125: Uint32Array, 5126: Float32Array };
const SIZES = { SCALAR: 1, VEC2: 2, VEC3: 3 };

// {origin: [east, north, up] or null, parts: [{position, uv, triangles, picture}], pictures: [{blob, size: [w, h]}]}; positions x east,
// y up, z south.
export function readGlb(buffer) {
  const view = new DataView(buffer);
  const length = view.getUint32(JSON_CHUNK_AT, true);
  const said = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, JSON_CHUNK_AT + 8, length)));
  const data = JSON_CHUNK_AT + 8 + length + 8;
  const place = ({ bufferView, byteOffset = 0 }) => data + said.bufferViews[bufferView].byteOffset + byteOffset;
  const values = (number) => {
    const accessor = said.accessors[number];
    const kind = KINDS[accessor.componentType];
    return new kind(buffer, place(accessor), accessor.count * SIZES[accessor.type]);
  };
  const parts = (said.meshes || []).flatMap((mesh) => mesh.primitives.map((primitive) => ({
    position: values(primitive.attributes.POSITION),
    uv: values(primitive.attributes.TEXCOORD_0),
    triangles: Uint32Array.from(values(primitive.indices)),
    picture: said.textures[said.materials[primitive.material].pbrMetallicRoughness.baseColorTexture.index].source,
  })));
  const pictures = (said.images || []).map((image) => {
    const bytes = new Uint8Array(buffer, place(image), said.bufferViews[image.bufferView].byteLength);
    return { blob: new Blob([bytes], { type: image.mimeType }), size: jpegSize(bytes) };
  });
  return { origin: said.scenes[0].extras?.origin || null, parts, pictures };
}

// Width and height of a JPEG, from its frame header.
function jpegSize(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  for (let at = 2; at < bytes.length - 9; at += 2 + view.getUint16(at + 2)) {
    const marker = view.getUint8(at + 1);
    if (marker >= 0xc0 && marker <= 0xcf && ![0xc4, 0xc8, 0xcc].includes(marker)) return [view.getUint16(at + 7), view.getUint16(at + 5)];
  }
  throw new Error("a texture is no JPEG");
}
