package colonnade.query

import chisel3._
import chiseltest._
import colonnade.axi.AxiMemory
import colonnade.config.ColonnadeConfig
import colonnade.formats.LoadTarget
import colonnade.{Model, Simulation}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.util.Random

private class RayColumnHarness(config: ColonnadeConfig) extends MemoryUnit {
  private val column = Module(new RayColumn(config)).io

  val registers = IO(Input(UInt(column.registers.getWidth.W)))
  val batch     = IO(chiselTypeOf(column.batch))
  val sensor    = IO(chiselTypeOf(column.sensor))
  val start     = IO(Input(Bool()))
  val load      = IO(chiselTypeOf(column.load))
  val runs      = IO(chiselTypeOf(column.runs))
  val resolved  = IO(chiselTypeOf(column.resolved))
  val failed    = IO(Output(Bool()))
  val events    = IO(chiselTypeOf(column.events))
  column.registers := registers.asTypeOf(column.registers)
  column.batch     := batch
  column.sensor    := sensor
  column.start     := start
  column.load      := load
  column.runs :<>= runs
  resolved := column.resolved
  failed   := column.failed
  events   := column.events
  attach(Some(column.read), Some(column.write))
}

/** Runs of a column of two rows have the hits of the model, and events of either row are told. */
class RayColumnSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "RayColumn"

  it should "give the hits of the model, and tell what happens in each of its rows" in {
    val config = RayConfigs.ofRows(2)
    test(new RayColumnHarness(config)).withAnnotations(Simulation.verilator) { dut =>
      val random   = new Random(1)
      val stimulus = new BatchStimulus(config, random)
      val bench    = new ColumnBench(dut, config, stimulus, random)
      bench.load(stimulus.scene.records)
      val batches  = Seq.tabulate(6)(i => stimulus.batch(Seq(66, 20, 130)(i % 3), i % 3, i / 2))
      val expected = Model.batches(config, stimulus.image, stimulus.scene.records, batches.map(_.query))
      for ((batch, words) <- batches.zip(expected))
        withClue(s"${batch.count} rays, mode ${batch.mode.toString(16)}: ") {
          bench.run(batch)
          bench.words(batch) shouldBe words
        }

      // One ray after the other, by the rows in turn
      val ray = stimulus.aimed(1, response = 1, form = 1)
      for (row <- 0 until 2 * config.array.rows) withClue(s"ray $row: ") {
        val seen = bench.run(ray)
        seen("raysInBox") shouldBe 1
        Seq("nodeReads", "boxTests").foreach(seen(_) should be > 0)
        Seq("raysRefused", "stackOverflow", "illegalRecord").foreach(seen(_) shouldBe 0)
      }
      bench.load(stimulus.scene.records, root = stimulus.scene.records.size)
      for (row <- 0 until config.array.rows) withClue(s"row $row: ")(bench.run(ray)("illegalRecord") should be > 0)
      bench.load(DeepTree.records(config))
      for (row <- 0 until config.array.rows) withClue(s"row $row: ") {
        val seen = bench.run(ray)
        seen("stackOverflow") should be > 0
        seen("illegalRecord") shouldBe 0
        dut.events.deepestStack.expect(config.columnBvhMemory.stackDepth)
      }
    }
  }
}

/** Runs batches in one column. */
private class ColumnBench(dut: RayColumnHarness, config: ColonnadeConfig, stimulus: BatchStimulus, random: Random)
    extends Matchers {
  private val memory = new AxiMemory(dut.pins, 64, random, stall = 30)
  private val rays   = BigInt(0x100000)
  private val hits   = BigInt(0x200000)
  dut.clock.setTimeout(0)

  def load(records: Seq[BigInt], root: Int = 0): Unit = {
    dut.registers.poke(RayConfigs.registers(config, stimulus, records.size, root))
    dut.load.valid.poke(true)
    dut.load.bits.target.poke(LoadTarget.columnBvh(config))
    for ((record, address) <- records.zipWithIndex) {
      dut.load.bits.address.poke(address)
      dut.load.bits.record.poke(record)
      dut.clock.step()
    }
    dut.load.valid.poke(false)
  }

  /** @return sums of the events */
  def run(batch: TestBatch): Map[String, Int] = {
    val sensor = TestSensor.of(batch.rays)
    val runs   = ReadBatch(batch.mode, batch.count, sensor).runs(rays, hits).toSeq
    memory.store(rays, batch.rays)
    memory.store(hits, Seq.fill(batch.hitBytes / 4)(BigInt(0)))
    FloatPorts.poke(dut.batch, batch.mode, batch.shared)
    sensor.poke(dut.sensor)
    dut.start.poke(true)
    dut.clock.step()
    dut.start.poke(false)
    val sums                           = scala.collection.mutable.Map.empty[String, Int].withDefaultValue(0)
    var (next, resolved, cycles, idle) = (0, 0, 0, 0)
    while (idle < 30) {
      dut.runs.valid.poke(next < runs.size)
      for ((at, to, count, dir, isTile) <- runs.lift(next)) {
        at.foreach(dut.runs.bits.rays.poke(_))
        dut.runs.bits.hits.poke(to)
        dut.runs.bits.count.poke(count)
        dir.toSeq.flatten.zip(dut.runs.bits.dir).foreach { case (from, port) => port.poke(from) }
        dut.runs.bits.isTile.poke(isTile)
      }
      memory.cycle()
      if (next < runs.size && dut.runs.ready.peekBoolean()) next += 1
      resolved += dut.resolved.peekInt().toInt
      dut.failed.expect(false)
      for ((name, event) <- dut.events.elements) sums(name) += event.asInstanceOf[UInt].peekInt().toInt
      if (resolved == runs.size) idle += 1
      dut.clock.step()
      cycles += 1
      cycles should be < 40000
    }
    resolved shouldBe runs.size
    sums.toMap.withDefaultValue(0)
  }

  def words(batch: TestBatch): Seq[BigInt] = memory.words(hits, batch.hitBytes / 4)
}
