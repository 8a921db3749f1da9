package colonnade.query

import chisel3._
import chiseltest._
import colonnade.axi.AxiMemory
import colonnade.config.ColonnadeConfig
import colonnade.formats.{LoadTarget, RayBatch}
import colonnade.{Model, Simulation}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.util.Random

private class RayArrayHarness(config: ColonnadeConfig) extends MemoryUnit(RayPort.idBits(config.array.columns + 1)) {
  private val array = Module(new RayArray(config)).io

  val registers  = IO(Input(UInt(array.registers.getWidth.W)))
  val tail       = IO(chiselTypeOf(array.tail))
  val head       = IO(chiselTypeOf(array.head))
  val load       = IO(chiselTypeOf(array.load))
  val isBusy     = IO(Output(Bool()))
  val batchError = IO(Output(Bool()))
  val raysDone   = IO(Output(UInt(32.W)))
  array.registers  := registers.asTypeOf(array.registers)
  array.tail       := tail
  array.invalidate := false.B
  array.load :<>= load
  head       := array.head
  isBusy     := array.isBusy
  batchError := array.batchError
  raysDone   := array.raysDone
  attachHeld(array.read, array.write)
}

/** Batches whose runs are traced by two columns have the hits of the model; the errors of each column are theirs. */
class RayArraySpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "RayArray"

  it should "give the hits of the model, and name batches of which a run fails in any column" in {
    val config = RayConfigs.ofColumns(2)
    test(new RayArrayHarness(config)).withAnnotations(Simulation.verilator) { dut =>
      val random   = new Random(2)
      val stimulus = new BatchStimulus(config, random)
      val bench    = new ArrayBench(dut, config, stimulus, random)
      bench.load(stimulus.scene.records)
      val batches  = Seq((130, 0, 0), (200, 1, 1), (320, 2, 2), (320, 0, 2)).map((stimulus.batch _).tupled)
      val expected = Model.batches(config, stimulus.image, stimulus.scene.records, batches.map(_.query))
      for ((batch, words) <- batches.zip(expected))
        withClue(s"${batch.count} rays, mode ${batch.mode.toString(16)}: ") {
          bench.run(batch) shouldBe false
          bench.words(batch) shouldBe words
        }

      // Of one run each, by the columns in turn
      val ray                                  = stimulus.aimed(1, response = 1, form = 1)
      def inEachColumn(isError: Boolean): Unit =
        for (column <- 0 until config.array.columns) withClue(s"column $column: ")(bench.run(ray) shouldBe isError)
      inEachColumn(false)
      bench.isUnreadable = true
      inEachColumn(true)
      bench.isUnreadable = false
      inEachColumn(false)
      bench.load(stimulus.scene.records, root = stimulus.scene.records.size)
      inEachColumn(true)
      bench.load(DeepTree.records(config))
      inEachColumn(true)
    }
  }
}

/** Runs batches, one after the other. */
private class ArrayBench(dut: RayArrayHarness, config: ColonnadeConfig, stimulus: BatchStimulus, random: Random)
    extends Matchers {
  private val memory  = new AxiMemory(dut.pins, 64, random, stall = 30)
  private val rays    = BigInt(0x100000)
  private val hits    = BigInt(0x200000)
  private val done    = BigInt(0x300000)
  private var batches = 0

  /** The rays of batches. */
  var isUnreadable = false
  memory.response = address => if (isUnreadable && address == rays) 2 else 0
  dut.clock.setTimeout(0)

  def load(records: Seq[BigInt], root: Int = 0): Unit = {
    dut.registers.poke(RayConfigs.registers(config, stimulus, records.size, root))
    dut.load.bits.target.poke(LoadTarget.columnBvh(config))
    dut.load.valid.poke(true)
    for ((record, address) <- records.zipWithIndex) {
      dut.load.ready.expect(true)
      dut.load.bits.address.poke(address)
      dut.load.bits.record.poke(record)
      dut.clock.step()
    }
    dut.load.valid.poke(false)
    dut.clock.step(2)
  }

  /** @return whether the batch has failed */
  def run(batch: TestBatch): Boolean = {
    memory.store(rays, batch.rays)
    memory.store(hits, Seq.fill(batch.hitBytes / 4)(BigInt(0)))
    memory.store(RayConfigs.ring + 64 * (batches % 4), batch.words(rays, hits, 7 + batches, done))
    batches += 1
    dut.tail.poke(batches)
    var (cycles, errors) = (0, 0)
    var counted          = BigInt(0)
    while (dut.head.peekInt() != batches) {
      memory.cycle()
      dut.load.ready.expect(false)
      if (dut.batchError.peekBoolean()) errors += 1
      counted += dut.raysDone.peekInt()
      dut.clock.step()
      cycles += 1
      cycles should be < 40000
    }
    dut.isBusy.expect(false)
    counted shouldBe batch.count
    val tag = memory.words(done, 1).head
    tag & ~RayBatch.errorBit shouldBe 7 + batches - 1
    errors shouldBe (if (tag.testBit(31)) 1 else 0)
    tag.testBit(31)
  }

  def words(batch: TestBatch): Seq[BigInt] = memory.words(hits, batch.hitBytes / 4)
}
