package colonnade.environment

import chisel3._
import chisel3.util.{Decoupled, DecoupledIO, Mux1H, Queue, RegEnable, UIntToOH, Valid}
import colonnade.common.{Context, ContextTable, First}
import colonnade.config.PathConfig
import colonnade.shading.EnvironmentSurface

/** The ray of a context, for the table of [[EnvironmentRays]]. */
final class StoredRay(config: PathConfig) extends Bundle {
  val context = Context(config)
  val ray     = new EnvironmentRay(config)
}

final class EnvironmentRaysIO(config: PathConfig) extends Bundle {
  val isMapCamera = Input(Bool())                         // direct views are for the pipeline, not for the marches
  val ray         = Flipped(Valid(new StoredRay(config))) // stored in place of the context's previous ray
  val req     = Flipped(Decoupled(new EnvironmentRequest(config))) // ready as `accepts` says of its kind
  val accepts = Output(new EnvironmentAccepts)
  val hitDistance = Input(HitDistance(config)) // of an occlusion test, in the cycle after its `req`

  /** A context whose point goes to the shader once more, since no ray has been stored in its place. */
  val again = Flipped(Valid(Context(config)))

  /** The result: a point to shade, a context whose ray misses, or one whose occlusion test finds its hit visible. */
  val surface = Decoupled(new EnvironmentSurface(config))
  val miss    = Valid(Context(config))
  val visible = Valid(Context(config))
  val marches = new MarchPort(config)
}

/** Stores each context's ray, sends it to the marches of the column, and stores the point that comes back in its place,
  * until the shader takes it. So a result never waits for the shader, and all contexts may be under way at a time.
  *
  * The table's read port serves an order, when the column takes one, and else the shader. A surface that has not been
  * taken is read again, so `surface.valid` may fall before it is taken. A new ray goes before a result.
  */
final class EnvironmentRays(config: PathConfig) extends Module {
  val io = IO(new EnvironmentRaysIO(config))

  private val column  = io.marches
  private val result  = column.answer
  private val rayType = new EnvironmentRay(config)
  private val point   = new EnvironmentSurface(config)
  private val table   = ContextTable(config, UInt(rayType.getWidth.max(point.getWidth).W))

  // Rays and points into the table
  result.ready := !io.ray.valid
  when(io.ray.valid || (result.valid && result.bits.isHit)) {
    table.write(
      Mux(io.ray.valid, io.ray.bits.context, result.bits.surface.context),
      Mux(io.ray.valid, io.ray.bits.ray.asUInt, result.bits.surface.asUInt)
    )
  }

  // A request of each kind waits until the column takes it; its ray is read then
  private val isDirect = io.req.bits.isDirectView && io.isMapCamera
  private val march    = new Waiting(column.march, !isDirect)
  private val direct   = new Waiting(column.direct, isDirect)
  private val kinds    = Seq(direct, march)
  private val isTaken  = kinds.map(_.isTaken).reduce(_ || _)
  private val taken    = Mux1H(kinds.map(kind => kind.isTaken -> kind.request.bits))
  private val leaves   = kinds.map(kind => RegNext(kind.isTaken, false.B))
  io.accepts.march         := march.accepts
  io.accepts.directView    := Mux(io.isMapCamera, direct.accepts, march.accepts)
  io.req.ready             := Mux(isDirect, direct.accepts, march.accepts)
  column.order.request     := RegEnable(taken, isTaken)
  column.order.hitDistance := Mux1H(leaves, kinds.map(_.hitDistance))

  // Points wait in the table; one of them is offered to the shader
  private val hasPoint  = RegInit(VecInit.fill(config.contexts)(false.B))
  private val isChosen  = RegInit(false.B)
  private val chosen    = Reg(Context(config))
  private val isOffered = RegNext(!isTaken && isChosen && !io.surface.fire, false.B)
  when(result.fire && result.bits.isHit) { hasPoint(result.bits.surface.context) := true.B }
  when(io.again.valid) { hasPoint(io.again.bits) := true.B }
  private val others = VecInit(hasPoint.zip(UIntToOH(chosen, config.contexts).asBools).map { case (has, isLast) =>
    has && !(isChosen && isLast)
  })
  when(!isChosen || io.surface.fire) {
    isChosen := others.asUInt.orR
    chosen   := First(others).bits
  }
  when(io.surface.fire)(hasPoint(chosen) := false.B)

  private val entry = table.read(Mux(isTaken, taken.context, chosen), isTaken || isChosen)
  column.order.ray := entry(rayType.getWidth - 1, 0).asTypeOf(rayType)
  io.surface.valid := isOffered
  io.surface.bits  := entry(point.getWidth - 1, 0).asTypeOf(point)
  io.miss.valid    := result.fire && !result.bits.isHit && !result.bits.isOcclusionTest
  io.miss.bits     := result.bits.surface.context
  io.visible.valid := result.fire && !result.bits.isHit && result.bits.isOcclusionTest
  io.visible.bits  := result.bits.surface.context

  /** A place for a request of one kind, in front of its taker in the column. */
  private class Waiting(taker: DecoupledIO[EnvironmentRequest], isOfKind: Bool) {
    private val enters = Wire(chiselTypeOf(taker))
    enters.valid := io.req.valid && isOfKind
    enters.bits  := io.req.bits
    val request = Queue(enters, 1)
    val accepts = enters.ready
    val isTaken = request.fire
    taker :<>= request

    val hitDistance = RegEnable(io.hitDistance, RegNext(enters.fire, false.B)) // comes in the cycle after the request
  }
}
