package colonnade.column

import chisel3._
import chisel3.util.random.LFSR
import chisel3.util.{Decoupled, Mux1H, PopCount, RRArbiter, Valid}
import colonnade.TestParts._
import colonnade.common.Dispatcher
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Pixel, PixelPosition, RecordBroadcast, RecordFormats, RecordRequest, UnitPosition}
import colonnade.unit.TraversalEvents

/** Renders each pixel by a chain of records: the position names the first one, each record the next one, with random
  * pauses. There is a pixel in flight for each row. With `shading.shadows` it hangs at [[FakePathTracer.hangsAt]]; with
  * `shading.flat` it reports an illegal record for each pixel of column 5.
  */
final class FakePathTracer(config: ColonnadeConfig) extends PathTracerModule(config) {
  private val rows = Seq.fill(config.array.rows)(Module(new FakeRow(config)).io)

  io.marches.foreach(_.tieOff())
  io.texture.foreach(_.req.valid := false.B)
  io.texture.foreach(_.req.bits := DontCare)
  io.cube.foreach(_.read.valid := false.B)
  io.cube.foreach(_.read.bits := DontCare)
  io.requests.last.valid := false.B
  io.requests.last.bits  := DontCare
  io.environmentLeaves   := false.B
  io.events              := 0.U.asTypeOf(io.events)

  private val dispatch = Module(new Dispatcher(new UnitPosition(config), rows.size)).io
  private val pixels   = Module(new RRArbiter(new Pixel(config), rows.size)).io
  dispatch.items :<>= io.positions
  io.pixels :<>= pixels.out
  for ((row, index) <- rows.zipWithIndex) {
    row.flat       := io.registers.shading.flat
    row.hangs      := io.registers.shading.shadows
    row.start      := io.start
    row.broadcasts := io.broadcasts
    row.positions :<>= dispatch.takers(index)
    io.requests(index) :<>= row.requests
    pixels.in(index) :<>= row.pixels
    io.events.traversal(index) := row.events
  }
  io.isIdle                    := rows.map(_.isFree).reduce(_ && _)
  io.events.paths.idleContexts := PopCount(rows.map(_.isFree))
}

private final class FakeRowIO(config: ColonnadeConfig) extends Bundle {
  val flat       = Input(Bool())
  val hangs      = Input(Bool())
  val start      = Input(Bool())
  val broadcasts = Flipped(Vec(config.columnBvhMemory.banks, Valid(new RecordBroadcast(config))))
  val positions  = Flipped(Decoupled(new UnitPosition(config)))
  val requests   = Decoupled(new RecordRequest(config))
  val pixels     = Decoupled(new Pixel(config))
  val isFree     = Output(Bool())
  val events     = Output(new TraversalEvents(config))
}

private final class FakeRow(config: ColonnadeConfig) extends Module {
  import FakePathTracer._

  val io = IO(new FakeRowIO(config))

  private object State extends ChiselEnum {
    val free, asking, waiting, resting, leaving = Value
  }
  import State._

  private val state    = RegInit(free)
  private val position = Reg(new PixelPosition(config))
  private val address  = Reg(UInt(RecordFormats.addressBits(config).W))
  private val colour   = Reg(UInt(12.W))
  private val left     = Reg(UInt(4.W))
  private val deepest  = RegInit(0.U(3.W))
  private val luck     = LFSR(16, seed = Some(7))

  private val isStuck  = io.hangs && position.x === hangsAt._1.U && position.y === hangsAt._2.U
  private val meant    = io.broadcasts.map(b => b.valid && b.bits.address === address)
  private val isShown  = meant.reduce(_ || _)
  private val record   = Mux1H(meant, io.broadcasts.map(_.bits.record))
  private val isWanted = state === asking || state === waiting
  private val takes    = isWanted && isShown && !isStuck

  io.positions.ready       := state === free && luck(0)
  io.requests.valid        := state === asking && !isShown
  io.requests.bits.address := address
  io.pixels.valid          := state === leaving
  io.pixels.bits           := 0.U.asTypeOf(new Pixel(config))
  io.pixels.bits.x         := position.x
  io.pixels.bits.y         := position.y
  io.pixels.bits.colour.g  := colour
  io.isFree                := state === free

  when(io.positions.fire) {
    state      := asking
    position.x := io.positions.bits.x
    position.y := io.positions.bits.y
    address    := io.positions.bits.x * 7.U + io.positions.bits.y * 13.U
    colour     := 0.U
    left       := (reads - 1).U
  }
  when(io.requests.fire) { state := waiting }
  when(takes) {
    state   := Mux(left === 0.U, resting, asking)
    left    := left - 1.U
    colour  := colour + record(11, 0)
    address := record >> 12
  }
  when(state === resting && luck(3, 2) === 0.U) { state := leaving }
  when(io.pixels.fire) { state := free }
  when(io.start) { deepest := 0.U }.elsewhen(io.positions.fire && io.positions.bits.x(2, 0) > deepest) {
    deepest := io.positions.bits.x(2, 0)
  }

  io.events                           := 0.U.asTypeOf(io.events)
  io.events.intersector.nodeReads     := takes
  io.events.intersector.deepestStack  := deepest
  io.events.intersector.illegalRecord := io.flat && io.positions.fire && io.positions.bits.x === 5.U
  io.events.fetch.snoopHits           := takes && state === asking
  io.events.fetch.waitRecord          := isWanted
  io.events.fetch.waitUnit            := state === resting || state === leaving
}

object FakePathTracer {

  /** Number of records per pixel. */
  val reads: Int = 3

  val hangsAt: (Int, Int) = (3, 2)

  /** The expected green of a pixel. */
  def colour(config: ColonnadeConfig, records: Seq[BigInt], x: Int, y: Int): Int = {
    val depth = 1 << RecordFormats.addressBits(config)
    (1 to reads)
      .foldLeft((0, (x * 7 + y * 13) % depth)) { case ((sum, address), _) =>
        val record = records(address)
        ((sum + (record & 4095).toInt) & 4095, ((record >> 12) & (depth - 1)).toInt)
      }
      ._1
  }
}
