package colonnade.query

import chisel3._
import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.formats.{RayBatch, RayPlacement}
import colonnade.{Model, Packed, Simulation}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.util.Random

/** Packs the settings into one port each. */
private class RayArrayHarness(config: ColonnadeConfig) extends Module {
  private val array = Module(new RayArray(config)).io

  val scene  = IO(Input(UInt(array.scene.getWidth.W)))
  val ring   = IO(Input(UInt(array.ring.getWidth.W)))
  val tail   = IO(chiselTypeOf(array.tail))
  val head   = IO(chiselTypeOf(array.head))
  val load   = IO(chiselTypeOf(array.load))
  val read   = IO(chiselTypeOf(array.read))
  val write  = IO(chiselTypeOf(array.write))
  val isBusy = IO(Output(Bool()))
  val error  = IO(Output(Bool()))
  array.scene      := scene.asTypeOf(array.scene)
  array.ring       := ring.asTypeOf(array.ring)
  array.tail       := tail
  head             := array.head
  isBusy           := array.isBusy
  error            := array.batchError
  array.invalidate := false.B
  array.memoryHolds.foreach(_ := 0.U)
  array.load :<>= load
  read :<>= array.read
  write :<>= array.write
}

/** Hits of batches equal the model's byte for byte, whatever the memory does. */
class RayArraySpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "RayArray"

  private val tiny  = RayConfigs.tiny
  private val small = tiny.copy(
    array = tiny.array.copy(rows = 2, columns = 2, contexts = 8),
    units = tiny.units.copy(triangleRows = 2)
  )

  answers("tiny", tiny)
  answers("two columns of two rows", small)
  answers("24-bit vertices", RayConfigs.withVertices(24, 32))

  private def answers(name: String, config: ColonnadeConfig): Unit =
    it should s"answer batches as the model does, $name" in
      test(new RayArrayHarness(config)).withAnnotations(Simulation.verilator) { dut =>
        val fast = new RayBatches(dut, config, stall = 0, maxDelay = 3, seed = 1).run(Seq(130, 64, 200, 1, 65, 100))
        val slow = new RayBatches(dut, config, stall = 60, maxDelay = 90, seed = 2).run(Seq(70, 1, 63, 129, 20, 33))
        info(s"560 rays in $fast cycles, 316 of a slow memory in $slow")
      }
}

/** Runs batches of all forms, a refused one and one that cannot be read among them. */
private class RayBatches(dut: RayArrayHarness, config: ColonnadeConfig, stall: Int, maxDelay: Int, seed: Int)
    extends Matchers {
  private val random   = new Random(seed)
  private val stimulus = new BatchStimulus(config, random)
  private val memory   = new RayMemory(dut.read, dut.write, random, stall, maxDelay)
  private val ringLog  = 2
  private val ringBase = BigInt(0x12340c0)
  private val tags     = BigInt(0x500000)

  dut.clock.setTimeout(0)
  dut.tail.poke(0)
  dut.reset.asBool.poke(true)
  dut.clock.step()
  dut.reset.asBool.poke(false)
  dut.scene.poke(new Packed(new RayScene(config)).pack(
    stimulus.scene.registers.collect {
      case (name, value) if name.startsWith("scene.") || name.startsWith("bounds.") => name -> value
    } ++ new Packed(new RayPlacement).unpack(stimulus.placed.packed).map { case (name, value) =>
      s"placement.$name" -> value
    }
  ))
  dut.ring.poke((ringBase << 4) + ringLog)
  dut.load.valid.poke(true)
  for ((record, address) <- stimulus.scene.records.zipWithIndex) {
    dut.load.bits.address.poke(address)
    dut.load.bits.record.poke(record)
    dut.clock.step()
  }
  dut.load.valid.poke(false)
  dut.clock.step(2)

  /** @param counts rays of each batch
    * @return cycles
    */
  def run(counts: Seq[Int]): Int = {
    val batches        = for ((count, i) <- counts.zipWithIndex) yield stimulus.batch(count, i % 3, isFan = i >= 3)
    val answers        = Model.batches(config, stimulus.image, stimulus.scene.records, batches.map(_.question))
    val addresses      = batches.indices.map(i => (BigInt(0x100f80) + i * 0x4000, BigInt(0x200fc0) + i * 0x4000))
    val refused        = 2 // an extra batch of an unknown mode, and one whose rays cannot be read
    val broken         = 4
    var (tail, cycles) = (0, 0)

    def submit(words: Seq[BigInt]): Unit = {
      while (((tail - dut.head.peekInt().toInt) & 0xffff) >= (1 << ringLog) - 1) step()
      memory.store(ringBase + 64 * (tail % (1 << ringLog)), words)
      tail += 1
      dut.tail.poke(tail)
    }
    def step(): Unit = {
      memory.cycle()
      dut.clock.step()
      cycles += 1
      withClue(s"head ${dut.head.peekInt()} of $tail: ") { cycles should be < 400000 }
    }
    for ((batch, i) <- batches.zipWithIndex) {
      val (rays, hits) = addresses(i)
      memory.store(rays, batch.rays)
      memory.store(hits, Seq.fill(batch.hitBytes / 4 + 16)(BigInt(0x5a5a5a5a)))
      if (i == refused) submit(batch.copy(mode = batch.mode | 4).words(rays, hits, 77, tags + 4 * 40))
      if (i == broken) {
        memory.broken += rays + 0x3000
        submit(batch.words(rays + 0x3000, hits, 78, tags + 4 * 41))
      }
      submit(batch.words(rays, hits, 1000 + i, tags + 4 * i))
    }
    while (dut.isBusy.peekBoolean()) step()
    for (((batch, (_, hits)), answer) <- batches.zip(addresses).zip(answers)) withClue(s"$batch: ".take(80)) {
      memory.words(hits, batch.hitBytes / 4) shouldBe answer
      memory.words(hits + batch.hitBytes, 16).toSet shouldBe Set(BigInt(0x5a5a5a5a))
    }
    batches.indices.foreach(i => memory.words(tags + 4 * i, 1) shouldBe Seq(BigInt(1000 + i)))
    Seq(77 -> 40, 78 -> 41).foreach { case (tag, at) =>
      memory.words(tags + 4 * at, 1) shouldBe Seq(tag + RayBatch.errorBit)
    }
    memory.maxId shouldBe config.array.columns
    cycles
  }
}
