package colonnade.environment

import chisel3._
import colonnade.formats.{AlbedoEntry, NormalEntry}

/** What the point that a ray meets is made of: its texel from the maps, or from the shell. It is asked for as soon as it
  * is known which one, and comes while the place is worked out.
  */
final class MarchTexel(m: MarchDatapath, planes: MarchPlanes, pixels: MarchPixels, maps: AttributePort) {
  import m.program._

  val albedo: AlbedoEntry = Reg(new AlbedoEntry)
  val normal: NormalEntry = Reg(new NormalEntry)

  private val asksAlbedo  = RegInit(false.B)
  private val asksNormal  = RegInit(false.B)
  private val awaitsShell = RegInit(false.B)
  private val hasAlbedo   = Reg(Bool())
  private val hasNormal   = Reg(Bool())

  /** Both are there. */
  val isThere: Bool = hasAlbedo && hasNormal

  /** In a step of [[askShell]]: it is asked for. */
  def isShellAsked: Bool = maps.planes.question.ready

  maps.albedo.question.valid           := asksAlbedo
  maps.albedo.question.bits.tag        := 0.U
  maps.albedo.question.bits.content.x  := pixels.x
  maps.albedo.question.bits.content.y  := pixels.y
  maps.normals.question.valid          := asksNormal
  maps.normals.question.bits           := maps.albedo.question.bits
  when(maps.albedo.question.ready)(asksAlbedo  := false.B)
  when(maps.normals.question.ready)(asksNormal := false.B)
  when(maps.albedo.answer.valid) {
    albedo    := maps.albedo.answer.bits.content
    hasAlbedo := true.B
  }
  when(maps.normals.answer.valid) {
    normal    := maps.normals.answer.bits.content
    hasNormal := true.B
  }
  when(awaitsShell && maps.planes.answer.valid) {
    albedo      := maps.planes.answer.bits.content.albedo
    normal      := maps.planes.answer.bits.content.normal
    hasAlbedo   := true.B
    hasNormal   := true.B
    awaitsShell := false.B
  }

  /** In a step: asks for the pixel's. From here on the ray must not end without it. */
  def ask(): Unit = {
    set(asksAlbedo, true.B)
    set(asksNormal, true.B)
    forget()
  }

  /** In a step that is repeated until [[isShellAsked]]: asks for that of an entry of the shell. */
  def askShell(entry: UInt, condition: Bool): Unit = {
    planes.askShell(entry, condition)
    set(awaitsShell, isShellAsked, condition)
    forget()
  }

  private def forget(): Unit = {
    set(hasAlbedo, false.B)
    set(hasNormal, false.B)
  }
}
