package colonnade.query

import chisel3._
import chiseltest._
import colonnade.OneSimulation
import colonnade.axi.AxiMemory
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.collection.mutable
import scala.util.Random

private class HitWriterHarness extends MemoryUnit {
  private val writer = Module(new HitWriter).io

  val address = IO(chiselTypeOf(writer.address))
  val isWide  = IO(Input(Bool()))
  val hits    = IO(chiselTypeOf(writer.hits))
  val written = IO(Output(Bool()))
  val failed  = IO(Output(Bool()))
  val isIdle  = IO(Output(Bool()))
  writer.address := address
  writer.isWide  := isWide
  writer.hits :<>= hits
  written := writer.written
  failed  := writer.failed
  isIdle  := writer.isIdle
  attach(write = Some(writer.axi))
}

/** Words of runs are where they belong, and no others; each run ends once, well or not, in order. */
class HitWriterSpec extends AnyFlatSpec with OneSimulation with Matchers {
  behavior of "HitWriter"

  inOneSimulation(new HitWriterHarness)(
    "write hits of a whole beat and of parts of one"    -> write(isWide = true, stall = 50, maxDelay = 20),
    "write ranges from any word on"                     -> write(isWide = false, stall = 50, maxDelay = 20),
    "end runs whose responses come long after others"   -> write(isWide = false, stall = 0, maxDelay = 900),
    "name runs of which a burst fails, whichever it is" -> write(
      isWide = true,
      stall = 20,
      maxDelay = 40,
      fails = true
    ),
    "name single words of which the write fails" -> write(isWide = false, stall = 0, maxDelay = 60, fails = true)
  )

  /** Consecutive words: their address and number; the last ones of their run. */
  private case class Row(address: BigInt, count: Int, isEnd: Boolean)

  private def write(isWide: Boolean, stall: Int, maxDelay: Int, fails: Boolean = false)(dut: HitWriterHarness): Unit = {
    val random = new Random(stall + maxDelay)
    val memory = new AxiMemory(dut.pins, 64, random, stall)
    val size   = if (isWide) 16 else 8
    memory.maxDelay = maxDelay
    dut.clock.setTimeout(0)
    dut.isWide.poke(isWide)

    // Runs of a row, of the four rows of a tile, or of one word, 4 KB apart
    val runs = Seq.tabulate(60) { run =>
      def row(count: Int, part: Int, isEnd: Boolean) = {
        val start = if (isWide) 0 else 8 * random.nextInt(8)
        Row(
          BigInt(0x100000 + 0x1000 * run + 0x400 * part + start + (if (count <= 16) 64 * random.nextInt(8) else 0)),
          count,
          isEnd
        )
      }
      random.nextInt(3) match {
        case 0 => Seq(row(if (random.nextBoolean()) Run.rays else 1 + random.nextInt(Run.rays), 0, isEnd = true))
        case 1 => Seq.tabulate(Run.tileRows)(part => row(Run.tileColumns, part, part + 1 == Run.tileRows))
        case _ => Seq(row(1, 0, isEnd = true))
      }
    }
    val failing         = mutable.Set.empty[BigInt] // beats; the burst that begins there fails
    def beats(row: Row) = (row.address / 64 to (row.address + row.count * size - 1) / 64).map(_ * 64)
    if (fails) for (rows <- runs if random.nextInt(3) == 0) {
      val begins = rows.flatMap(row => beats(row).filter(at => at == beats(row).head || at / 64 % Run.burstBeats == 0))
      failing += begins(random.nextInt(begins.size))
    }
    memory.response = address => if (failing(address / 64 * 64)) 2 else 0

    val words    = runs.flatten.map(row => Seq.fill(row.count)(BigInt(8 * size, random)))
    val expected =
      (for ((row, values) <- runs.flatten.zip(words); (value, i) <- values.zipWithIndex; byte <- 0 until size)
        yield row.address + i * size + byte -> ((value >> (8 * byte)) & 255).toInt).toMap
    val sent = mutable.Queue.from(for ((row, values) <- runs.flatten.zip(words); (value, i) <- values.zipWithIndex)
      yield (row, value, i + 1 == row.count))
    val outcomes = mutable.ArrayBuffer.empty[Boolean]
    var cycles   = 0
    while (outcomes.size < runs.size) {
      val offers = sent.nonEmpty && random.nextInt(100) >= stall
      dut.hits.valid.poke(offers)
      for ((row, value, isLast) <- sent.headOption) {
        dut.address.poke(row.address)
        dut.hits.bits.words.poke(value)
        dut.hits.bits.isLast.poke(isLast)
        dut.hits.bits.isEnd.poke(isLast && row.isEnd)
      }
      memory.cycle()
      if (offers && dut.hits.ready.peekBoolean()) sent.dequeue()
      (dut.written.peekBoolean(), dut.failed.peekBoolean()) match {
        case (true, true)   => fail("a run ends twice")
        case (false, false) =>
        case (_, failed)    => outcomes += failed
      }
      dut.clock.step()
      cycles += 1
      cycles should be < 40000
    }
    sent shouldBe empty
    dut.hits.valid.poke(false)
    for (_ <- 0 until maxDelay + 20) {
      memory.cycle()
      dut.written.expect(false)
      dut.failed.expect(false)
      dut.clock.step()
    }
    dut.isIdle.expect(true)
    memory.isIdle shouldBe true
    outcomes shouldBe runs.map(_.exists(row => beats(row).exists(failing)))
    memory.bytes.toMap shouldBe expected
  }
}
