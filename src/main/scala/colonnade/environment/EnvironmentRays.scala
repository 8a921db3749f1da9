package colonnade.environment

import chisel3._
import chisel3.util.{Queue, RegEnable}
import colonnade.common.{Context, ContextTable, First}
import colonnade.config.ColonnadeConfig
import colonnade.shading.EnvironmentSurface

/** Stores each context's ray, sends it to the marches of the column, and stores the point that comes back in its place,
  * until the shader takes it. So an answer never waits for the shader, and all contexts may be under way at a time.
  *
  * The table's read port serves an order, when the column takes one, and else the shader. A surface that has not been taken
  * is read again, so `surface.valid` may fall before it is taken. A new ray goes before an answer.
  */
final class EnvironmentRays(config: ColonnadeConfig) extends Module {
  val io = IO(new EnvironmentStageIO(config))

  private val column  = io.marches.get
  private val answer  = column.answer
  private val rayType = new EnvironmentRay(config)
  private val point   = new EnvironmentSurface(config)
  private val table   = ContextTable(config, UInt(rayType.getWidth.max(point.getWidth).W))
  io.events := 0.U.asTypeOf(io.events)

  // Rays and points into the table
  answer.ready := !io.ray.valid
  when(io.ray.valid || (answer.valid && answer.bits.isHit)) {
    table.write(
      Mux(io.ray.valid, io.ray.bits.context, answer.bits.surface.context),
      Mux(io.ray.valid, io.ray.bits.ray.asUInt, answer.bits.surface.asUInt)
    )
  }

  // A request waits until the column takes it; its ray is read then
  private val request = Queue(io.req, 1)
  private val isTaken = request.fire
  column.req :<>= request
  column.order.hitDistance := RegEnable(io.hitDistance, RegNext(io.req.fire, false.B))
  column.order.request     := RegEnable(request.bits, isTaken)

  // Points wait in the table; one of them is offered to the shader
  private val hasPoint  = RegInit(VecInit.fill(config.array.contexts)(false.B))
  private val isChosen  = RegInit(false.B)
  private val chosen    = Reg(Context(config))
  private val isOffered = RegNext(!isTaken && isChosen && !io.surface.fire, false.B)
  when(answer.fire && answer.bits.isHit) { hasPoint(answer.bits.surface.context) := true.B }
  when(!isChosen) {
    isChosen := hasPoint.asUInt.orR
    chosen   := First(hasPoint).bits
  }
  when(io.surface.fire) {
    isChosen         := false.B
    hasPoint(chosen) := false.B
  }

  private val entry = table.read(Mux(isTaken, request.bits.context, chosen), isTaken || isChosen)
  column.order.ray := entry(rayType.getWidth - 1, 0).asTypeOf(rayType)
  io.surface.valid := isOffered
  io.surface.bits  := entry(point.getWidth - 1, 0).asTypeOf(point)
  io.miss.valid    := answer.fire && !answer.bits.isHit && !answer.bits.isOcclusionTest
  io.miss.bits     := answer.bits.surface.context
  io.visible.valid := answer.fire && !answer.bits.isHit && answer.bits.isOcclusionTest
  io.visible.bits  := answer.bits.surface.context
}
