package colonnade.column

import chisel3._
import chisel3.util.random.LFSR
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Pixel, PixelPosition, RecordFormats}
import colonnade.unit.RenderUnitModule

/** Renders a pixel by a chain of records: the position names the first one, each record the next one, with random pauses.
  * With `shading.shadows` it hangs at [[FakeRenderUnit.hangsAt]]; with `shading.flat` it reports an illegal record
  * for each pixel of column 5.
  */
class FakeRenderUnit(config: ColonnadeConfig) extends RenderUnitModule(config) {
  import FakeRenderUnit._

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

  private val isStuck  = io.registers.shading.shadows && position.x === hangsAt._1.U && position.y === hangsAt._2.U
  private val meant    = io.broadcasts.map(b => b.valid && b.bits.address === address)
  private val isShown  = meant.reduce(_ || _)
  private val record   = chisel3.util.Mux1H(meant, io.broadcasts.map(_.bits.record))
  private val isWanted = state === asking || state === waiting
  private val takes    = isWanted && isShown && !isStuck

  io.positions.ready       := state === free && luck(0)
  io.requests.valid        := state === asking && !isShown
  io.requests.bits.address := address
  io.pixels.valid          := state === leaving
  io.maps.foreach(_.tieOff())
  io.marches.foreach(_.tieOff())
  io.pixels.bits          := 0.U.asTypeOf(new Pixel(config))
  io.pixels.bits.x        := position.x
  io.pixels.bits.y        := position.y
  io.pixels.bits.colour.g := colour
  io.isIdle               := state === free

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

  io.events               := 0.U.asTypeOf(io.events)
  io.events.nodeReads     := takes
  io.events.snoopHits     := takes && state === asking
  io.events.waitRecord    := isWanted
  io.events.waitUnit      := state === resting || state === leaving
  io.events.idleContexts  := state === free
  io.events.deepestStack  := deepest
  io.events.illegalRecord := io.registers.shading.flat && io.positions.fire && io.positions.bits.x === 5.U
}

object FakeRenderUnit {

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
