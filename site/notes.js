// Notes below the controls: what mesh, room and hardware hold and the picture does not show.

import { isAtMaps } from "./camera.js";
import { hasRegister } from "./design.js";
import { materialOf } from "./view.js";

/** The notes of a scene (view.js) in a room, or in none. */
export function notesOf(scene, room) {
  const { state, mesh, manifest, packed } = scene;
  const notes = [...mesh.notes, ...packed.notes, ...(room?.notes ?? [])];
  const count = (number) => number.toLocaleString("en");
  if (packed.dropped) notes.push(`${count(packed.dropped)} faces without area, or there twice, are left out`);
  if (packed.reversed) notes.push(`${count(packed.reversed)} closed parts did not point outward, and do now`);
  if (packed.flipped) notes.push(`normals of ${count(packed.flipped)} faces pointed to their back and are negated`);
  if (packed.smoothed)
    notes.push(`normal maps are smoothed: corner normals differ from them by ${packed.smoothed} degrees`);
  if (packed.flatPairs)
    notes.push(`${count(packed.flatPairs)} pairs of triangles are stretched so far that they are shaded flat`);
  if (mesh.hasColours && !hasRegister(manifest, "materials[0].hasCornerColours"))
    notes.push("this hardware has no corner colours: the mesh has one colour");
  if (state.room && !room)
    notes.push(manifest.attributes ? "the page has rooms for presets only" : "this hardware has no maps of a room");
  if (room && !isAtMaps(state)) notes.push("the camera is not that of the photo: the room is drawn from its maps");
  if (room?.light?.share)
    notes.push(
      `the photo shows ${Math.round(100 * room.light.share)} % of the directions around the object; ` +
        `its mean light comes from the others`,
    );
  const material = materialOf(scene, room);
  if (mesh.hasMaterials && material !== "file") notes.push("one material in place of those of the file");
  if (state.material === "metal" && material !== "metal")
    notes.push("rough metal is diffuse: hardware that gathers the light of a room renders its reflections");
  else if (material !== state.material && state.material !== "file")
    notes.push("this hardware has neither mirrors nor glass");
  return notes;
}
