package colonnade.bus

import chisel3.{assert => _, _}
import chisel3.util.Decoupled
import chiseltest._
import colonnade.{Simulation, TestConfigs}
import colonnade.config.{ColonnadeConfig, ShellConfig}
import org.scalatest.flatspec.AnyFlatSpec

import scala.collection.mutable
import scala.util.Random

/** The streamer behind its guard; `abandon` is a soft reset. */
private class GuardedStreamer(config: ColonnadeConfig, shell: ShellConfig) extends Module {
  val format  = IO(Input(UInt(PixelFormat.getWidth.W)))
  val rows    = IO(Flipped(Decoupled(new TileRow(config))))
  val abandon = IO(Input(Bool()))
  val out     = IO(Decoupled(new PixelBeat(shell.busBytes)))
  val isIdle  = IO(Output(Bool()))

  private val streamer = withReset(reset.asBool || abandon)(Module(new RowStreamer(config, shell)))
  private val guard    = Module(new StreamGuard(shell.busBytes))
  streamer.format := format
  streamer.rows :<>= rows
  guard.inner :<>= streamer.out
  guard.abandon := abandon
  out :<>= guard.out
  isIdle := streamer.isIdle && guard.isIdle
}

/** A row of a test. */
private final case class Row(tile: Int, y: Int, mask: BigInt, pixels: Seq[BigInt])

class RowStreamerSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "RowStreamer"

  /** What a packet says: the place of the row, and its bytes by number. */
  private type Packet = (BigInt, Map[Int, Int])

  private def expected(row: Row, tile: Int, bytes: Int): Packet = {
    val present = for ((pixel, x) <- row.pixels.zipWithIndex if row.mask.testBit(x); byte <- 0 until bytes)
      yield (bytes * x + byte) -> ((pixel >> (8 * byte)) & 255).toInt
    (BigInt(row.y) << 16 | row.tile * tile, present.toMap)
  }

  private class Bench(dut: GuardedStreamer, bus: Int, random: Random) {
    val packets                       = mutable.Buffer[Packet]()
    private var beats                 = Seq[Map[Int, Int]]()
    private var held: Option[BigInt]  = None
    private var place: Option[BigInt] = None
    dut.clock.setTimeout(0)

    /** A cycle; a beat that is offered holds until it is taken. */
    def cycle(): Unit = {
      val isReady = random.nextInt(3) > 0
      dut.out.ready.poke(isReady)
      if (dut.out.valid.peekBoolean()) {
        val Seq(data, keep, user) = Seq(dut.out.bits.data, dut.out.bits.keep, dut.out.bits.user).map(_.peekInt())
        val last                  = dut.out.bits.last.peekBoolean()
        val all                   = ((data << bus | keep) << 32 | user) << 1 | (if (last) 1 else 0)
        assert(held.forall(_ == all))
        held = Option.when(!isReady)(all)
        if (isReady) {
          assert(place.forall(_ == user))
          place = Some(user)
          beats :+= (0 until bus).filter(keep.testBit).map { byte =>
            (beats.size * bus + byte) -> ((data >> (8 * byte)) & 255).toInt
          }.toMap
          if (last) {
            packets += ((user, beats.flatten.toMap))
            beats = Nil
            place = None
          }
        }
      } else assert(held.isEmpty)
      dut.clock.step()
    }

    def send(row: Row): Unit = {
      dut.rows.valid.poke(true)
      dut.rows.bits.tile.poke(row.tile)
      dut.rows.bits.y.poke(row.y)
      dut.rows.bits.mask.poke(row.mask)
      dut.rows.bits.pixels.zip(row.pixels).foreach { case (port, pixel) => port.poke(pixel) }
      while (!dut.rows.ready.peekBoolean()) cycle()
      cycle()
      dut.rows.valid.poke(false)
    }

    def finish(): Unit = while (!dut.isIdle.peekBoolean()) cycle()
  }

  for ((bus, tile) <- Seq((4, 8), (16, 16), (64, 8)))
    it should s"send each row of $tile pixels as a packet of $bus bytes a beat, also after a reset in a packet" in {
      val config = TestConfigs.tiny.copy(frame = TestConfigs.tiny.frame.copy(tileSize = tile, hits = false))
      test(new GuardedStreamer(config, ShellConfig(bus))).withAnnotations(Simulation.verilator) { dut =>
        val random = new Random(bus)
        val bench  = new Bench(dut, bus, random)
        for (format <- 0 to 2) {
          dut.format.poke(format)
          val bytes = Seq(4, 2, 8)(format)
          val rows  = Seq.fill(40) {
            Row(
              random.nextInt(64),
              random.nextInt(1024),
              BigInt(tile, random),
              Seq.fill(tile)(BigInt(8 * bytes, random))
            )
          }
          bench.packets.clear()
          rows.foreach { row =>
            bench.send(row)
            if (random.nextInt(4) == 0) bench.finish()
          }
          bench.finish()
          assert(bench.packets == rows.map(expected(_, tile, bytes)))

          // A soft reset: what has been sent is right, and the next packet is whole
          for (_ <- 0 until 10) {
            bench.packets.clear()
            bench.send(rows.head)
            (0 until random.nextInt(6)).foreach(_ => bench.cycle())
            dut.abandon.poke(true)
            (0 until 2).foreach(_ => bench.cycle())
            bench.finish()
            dut.abandon.poke(false)
            val (place, sent) = expected(rows.head, tile, bytes)
            assert(bench.packets.forall { case (at, part) => at == place && part.toSet.subsetOf(sent.toSet) })
            assert(bench.packets.size <= 1)
            bench.packets.clear()
            bench.send(rows.last)
            bench.finish()
            assert(bench.packets == Seq(expected(rows.last, tile, bytes)))
          }
        }
      }
    }
}
