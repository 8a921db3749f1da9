package colonnade.shading

import chisel3._
import colonnade.common.ContextTable
import colonnade.config.ColonnadeConfig
import colonnade.formats.Vec3
import colonnade.numbers.{Fixed, Rounding}
import colonnade.ray.RayFormats

/** [[ShadowRays]] at two rays in three cycles: docs/shading.md. All axes at a time, one shifter and subtractor for each.
  *
  * A ray is offered two cycles after its request, in the order of the requests. A request that waits for the ray before it
  * reads its origin again, so no register holds the origin.
  */
final class ShadowRaysPipeline(config: ColonnadeConfig) extends Module {
  private val scene = new RayFormats(config.numbers).scene

  val io = IO(new ShadowRaysIO(config))

  private val origins = ContextTable(config, Vec3(new Fixed(scene)))
  when(io.surface.valid) { origins.write(io.surface.bits.context, io.surface.bits.origin) }

  // A request whose origin was read in the cycle before
  private val isHeld  = RegInit(false.B)
  private val request = Reg(new ShadowRequest(config))
  private val hasRay  = RegInit(false.B)
  private val moves   = isHeld && (!hasRay || io.ray.ready)
  private val repeats = isHeld && !moves
  private val origin  = origins.read(Mux(repeats, request.context, io.req.bits.context), repeats || io.req.fire)

  // Ready without a look at the ray's way out
  io.req.ready := !isHeld || !hasRay
  when(io.req.fire) {
    isHeld  := true.B
    request := io.req.bits
  }.elsewhen(moves) { isHeld := false.B }

  // Its ray
  private val ray   = Reg(chiselTypeOf(io.ray.bits))
  private val light = if (config.frame.lights == 1) io.lights.head else io.lights(request.light)
  when(moves) {
    ray.context := request.context
    ray.origin  := origin
    for (((dir, position), from) <- ray.dir.axes.zip(light.position.axes).zip(origin.axes)) {
      val shifted = Rounding.narrow((position.pad(scene.width) << io.unitShift).asSInt, scene.width)
      dir := shifted -& from.integer
    }
  }
  when(moves) { hasRay := true.B }.elsewhen(io.ray.ready) { hasRay := false.B }
  io.ray.valid         := hasRay
  io.ray.bits          := ray
  io.ray.bits.isShadow := true.B
}
