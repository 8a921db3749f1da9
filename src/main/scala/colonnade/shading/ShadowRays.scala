package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Valid}
import colonnade.common.{Context, ContextTable}
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.{Light, Vec3}
import colonnade.numbers.{Fixed, Rounding}
import colonnade.ray.{RayFormats, RayRequest}

/** A context and a light to trace a shadow ray to. */
final class ShadowRequest(config: PathConfig) extends Bundle {
  val context = Context(config)
  val light   = UInt(log2Ceil(config.device.frame.lights.max(2)).W)

  /** The ray is the one that gathers light at the surface instead. */
  val isGathered = Bool()
}

final class ShadowRaysIO(config: PathConfig) extends Bundle {
  val lights    = Input(Vec(config.device.frame.lights, new Light(config.numbers)))
  val unitShift = Input(UInt(NumberFormats.bitLength(config.numbers.sceneBits).W))

  /** The surface at which a context's shadow rays start; remembered. */
  val surface = Flipped(Valid(new LitSurface(config)))
  val req     = Flipped(Decoupled(new ShadowRequest(config)))
  val ray     = Decoupled(new RayRequest(config))
}

/** Makes shadow rays, from a context's surface to a light, and the rays that gather light there: docs/shading.md. Two
  * rays in three cycles; all axes at a time, one shifter and subtractor for each.
  *
  * A ray is offered two cycles after its request, in the order of the requests. A request that waits for the ray before
  * it reads its origin again, so no register holds the origin.
  */
final class ShadowRays(config: PathConfig) extends Module {
  private val scene = new RayFormats(config.numbers).scene

  val io = IO(new ShadowRaysIO(config))

  private val origins  = ContextTable(config, Vec3(new Fixed(scene)))
  private val scatters = io.surface.bits.scatter.map(scatter => ContextTable(config, chiselTypeOf(scatter)))
  when(io.surface.valid) {
    origins.write(io.surface.bits.context, io.surface.bits.origin)
    scatters.zip(io.surface.bits.scatter).foreach { case (table, dir) => table.write(io.surface.bits.context, dir) }
  }

  // A request whose origin was read in the cycle before
  private val isHeld  = RegInit(false.B)
  private val request = Reg(new ShadowRequest(config))
  private val hasRay  = RegInit(false.B)
  private val moves   = isHeld && (!hasRay || io.ray.ready)
  private val repeats = isHeld && !moves
  private val reads   = repeats || io.req.fire
  private val reader  = Mux(repeats, request.context, io.req.bits.context)
  private val origin  = origins.read(reader, reads)
  private val scatter = scatters.map(_.read(reader, reads))

  // Ready without a look at the ray's way out
  io.req.ready := !isHeld || !hasRay
  when(io.req.fire) {
    isHeld  := true.B
    request := io.req.bits
  }.elsewhen(moves) { isHeld := false.B }

  // Its ray
  private val ray   = Reg(chiselTypeOf(io.ray.bits))
  private val light = if (config.device.frame.lights == 1) io.lights.head else io.lights(request.light)
  when(moves) {
    ray.context  := request.context
    ray.isShadow := !request.isGathered
    ray.origin   := origin
    for (((dir, position), from) <- ray.dir.axes.zip(light.position.axes).zip(origin.axes)) {
      val shifted = Rounding.narrow((position.pad(scene.width) << io.unitShift).asSInt, scene.width)
      dir := shifted -& from.integer
    }
    for (scatter <- scatter) when(request.isGathered) {
      ray.dir.axes.zip(scatter.axes).foreach { case (to, from) => to := from }
    }
  }
  when(moves) { hasRay := true.B }.elsewhen(io.ray.ready) { hasRay := false.B }
  io.ray.valid := hasRay
  io.ray.bits  := ray
  io.ray.bits.leadsThroughWorld()
}
