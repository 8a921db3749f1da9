package colonnade.environment

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, DecoupledIO, Queue, RegEnable, Valid}
import colonnade.common.ReservedQueue
import colonnade.config.{AttributeLayout, PathConfig}
import colonnade.formats.{AlbedoEntry, EnvironmentView, NormalEntry, Plane}

final class DirectViewIO(config: PathConfig) extends Bundle {
  val view = Input(new EnvironmentView(config.numbers)) // constant while a frame runs

  /** A direct view, only in a cycle after one with `isReady` and without an order. All origins of a frame are equal. */
  val order   = Flipped(Valid(new MarchOrder(config)))
  val isReady = Output(Bool())

  val march  = Flipped(new PointSource(config))   // hits of marches, which share the last stage
  val answer = Decoupled(new MarchAnswer(config)) // in the order of orders, and of hits; offered until it is taken
  val maps = new AttributePort(AttributeLayout.of(config.device)) // several requests may be in flight in each channel
  val isIllegal = Output(Bool()) // a response is illegal
}

/** Finds the points of the environment that the camera sees directly: a pixel every four cycles, equal to what
  * [[EnvironmentMarch]] finds. {{{
  *
  * order ─▶ DirectProjection ─┬─ pixel of the map ─▶ cells ─▶ planes ─┐
  *                            ├─ place, rate of depth ──────────────▶ DirectDepth ─▶ distance ─┬─▶ DirectPoint ─▶
  * answer
  *                            │                                         └─▶ albedo, normals ──┘       ▲
  *                            └─ direction ───────────────────────────────────────────────────────────┘
  * }}}
  * A pixel has its place in every queue from its order on, so no response of the maps is ever without space.
  */
final class DirectView(config: PathConfig) extends Module {
  import DirectView._

  val io = IO(new DirectViewIO(config))

  private val projection = Module(new DirectProjection(config)).io
  private val depth      = Module(new DirectDepth(config)).io
  private val last       = Module(new DirectPoint(config)).io
  private val point      = last.sources(0)
  private val layout     = AttributeLayout.of(config.device)
  private val maps       = io.maps

  /** A queue of pixels, with its input. */
  private def queue[T <: Data](item: T, places: Int)(valid: Bool, bits: T): DecoupledIO[T] = {
    val queue = Module(new ReservedQueue(item, places)).io
    queue.in.valid    := valid
    queue.in.bits     := bits
    queue.mayTakeNext := true.B
    queue.out
  }

  /** The number of items between two events. */
  private def between(enters: Bool, leaves: Bool, most: Int): UInt = {
    val count = RegInit(0.U(log2Ceil(most + 1).W))
    count := count + enters - leaves
    count
  }

  // Orders, as long as there are places
  private val order = RegEnable(io.order.bits, io.order.valid)
  private val pixel = Wire(new DirectPixel(config))
  io.isReady           := projection.isReady && between(io.order.valid, point.pixel.fire, places) < (places - 1).U
  projection.view      := io.view
  projection.ray.valid := io.order.valid
  projection.ray.bits  := io.order.bits.ray
  pixel.request        := order.request
  pixel.hitDistance    := order.hitDistance
  pixel.dir            := projection.dir
  private val enters = projection.place.valid

  // The plane of each pixel's cell; cells and planes that are asked for have a place
  private val cells = Module(new Queue(new MapPixel(layout), 2)).io
  private val ids   = Module(new Queue(UInt(layout.planeIdBits.W), lookups)).io
  projection.hasSpace := cells.enq.ready
  cells.enq.valid     := enters
  cells.enq.bits      := projection.place.bits.pixel
  private val mayAskCell = between(maps.cells.req.fire, ids.deq.fire, lookups) < lookups.U
  maps.cells.req.valid                  := cells.deq.valid && mayAskCell
  maps.cells.req.bits.tag               := 0.U
  maps.cells.req.bits.content.pixel     := cells.deq.bits
  maps.cells.req.bits.content.wholeTile := false.B
  cells.deq.ready                       := maps.cells.req.ready && mayAskCell
  ids.enq.valid                         := maps.cells.resp.valid
  ids.enq.bits                          := maps.cells.resp.bits.content.ids(0)
  private val mayAskPlane = between(maps.planes.req.fire, depth.plane.fire, lookups) < lookups.U
  maps.planes.req.valid                        := ids.deq.valid && mayAskPlane
  maps.planes.req.bits.tag                     := 0.U
  maps.planes.req.bits.content.isBoundingPlane := false.B
  maps.planes.req.bits.content.index           := ids.deq.bits
  ids.deq.ready                                := maps.planes.req.ready && mayAskPlane

  // Depth and distance
  depth.view := io.view
  depth.place :<>= queue(new DirectPlace(config), places)(enters, projection.place.bits)
  depth.rate :<>= queue(new DirectRate(config), places)(projection.rate.valid, projection.rate.bits)
  depth.plane :<>= queue(new Plane, lookups)(maps.planes.resp.valid, maps.planes.resp.bits.content.plane)
  for ((channel, asks) <- Seq((maps.albedo, depth.albedo), (maps.normals, depth.normal))) {
    channel.req.valid        := asks.valid
    channel.req.bits.tag     := 0.U
    channel.req.bits.content := asks.bits
    asks.ready               := channel.req.ready
  }

  // The point
  last.view    := io.view
  point.origin := order.ray.origin
  point.pixel :<>= queue(new DirectPixel(config), places)(enters, pixel)
  point.distance :<>= depth.distance
  point.albedo :<>= queue(new AlbedoEntry, texels)(maps.albedo.resp.valid, maps.albedo.resp.bits.content)
  point.normal :<>= queue(new NormalEntry, texels)(maps.normals.resp.valid, maps.normals.resp.bits.content)
  last.sources(1) :<>= io.march
  io.answer :<>= last.answer
  io.isIllegal := Seq(maps.cells.resp, maps.albedo.resp, maps.normals.resp)
    .map(resp => resp.valid && resp.bits.isIllegal)
    .reduce(_ || _)
}

object DirectView {

  /** A register as wide as its input; Chisel's `RegEnable` does not know its width. */
  private[environment] def latch[T <: Data](next: T, enable: Bool = true.B): T = {
    val register = Reg(chiselTypeOf(next))
    when(enable)(register := next)
    register
  }

  val places:  Int = 16 // pixels in the pipeline
  val lookups: Int = 4  // cells that are asked for or wait for their plane; planes that are asked for or wait

  /** Pixels from the request for their albedo to their answer: one in `DirectDepth` when it asks, one before the
    * dividers, three in them, and two in `DirectPoint`.
    */
  val texels: Int = 8
}
