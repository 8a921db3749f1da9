package colonnade.environment

import chisel3._
import colonnade.formats.{AlbedoEntry, NormalEntry}

/** Fetches albedo and normal of a hit, from the maps or from a bounding plane. They are requested as soon as the pixel or
  * bounding plane is known, and arrive while the point is computed.
  */
final class TexelFetch(m: MarchOperations, planes: PlaneCache, hitPixel: HitPixel, maps: AttributePort) {
  import m.program._

  val albedo: AlbedoEntry = Reg(new AlbedoEntry)
  val normal: NormalEntry = Reg(new NormalEntry)

  private val requestsAlbedo      = RegInit(false.B)
  private val requestsNormal      = RegInit(false.B)
  private val awaitsBoundingPlane = RegInit(false.B)
  private val hasAlbedo           = Reg(Bool())
  private val hasNormal           = Reg(Bool())

  val isReady: Bool = hasAlbedo && hasNormal // both have arrived

  /** In a step with [[requestBoundingPlane]]: the request is accepted. */
  def isRequested: Bool = maps.planes.req.ready

  maps.albedo.req.valid           := requestsAlbedo
  maps.albedo.req.bits.tag        := 0.U
  maps.albedo.req.bits.content.x  := hitPixel.x
  maps.albedo.req.bits.content.y  := hitPixel.y
  maps.normals.req.valid          := requestsNormal
  maps.normals.req.bits           := maps.albedo.req.bits
  when(maps.albedo.req.ready)(requestsAlbedo  := false.B)
  when(maps.normals.req.ready)(requestsNormal := false.B)
  when(maps.albedo.resp.valid) {
    albedo    := maps.albedo.resp.bits.content
    hasAlbedo := true.B
  }
  when(maps.normals.resp.valid) {
    normal    := maps.normals.resp.bits.content
    hasNormal := true.B
  }
  when(awaitsBoundingPlane && maps.planes.resp.valid) {
    albedo              := maps.planes.resp.bits.content.albedo
    normal              := maps.planes.resp.bits.content.normal
    hasAlbedo           := true.B
    hasNormal           := true.B
    awaitsBoundingPlane := false.B
  }

  /** In a step: requests the pixel's texel. The program must await it before the ray ends. */
  def requestPixel(): Unit = {
    set(requestsAlbedo, true.B)
    set(requestsNormal, true.B)
    clear()
  }

  /** In a step that repeats until [[isRequested]]: requests a bounding plane's texel. */
  def requestBoundingPlane(index: UInt, condition: Bool): Unit = {
    planes.requestBoundingPlane(index, condition)
    set(awaitsBoundingPlane, isRequested, condition)
    clear()
  }

  private def clear(): Unit = {
    set(hasAlbedo, false.B)
    set(hasNormal, false.B)
  }
}
