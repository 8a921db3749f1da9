package colonnade

import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Access, RayBatch, RayPlacement, Register, RegisterMap}
import colonnade.query.{BatchStimulus, RayConfigs, RayMemory}
import org.scalatest.Tag
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.util.Random

/** Hits of batches equal the model's byte for byte, whatever the memory does. */
class ColonnadeRaysSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "ColonnadeRays"

  private val tiny  = RayConfigs.tiny
  private val small = tiny.copy(
    array = tiny.array.copy(rows = 2, columns = 2, contexts = 8),
    units = tiny.units.copy(triangleRows = 2)
  )

  check("tiny", tiny, Always)
  check("two columns of two rows", small, Matrix)
  check("24-bit vertices", RayConfigs.withVertices(24, 32), Matrix)

  private def check(name: String, config: ColonnadeConfig, tag: Tag): Unit =
    it should s"give the hits of the model, $name" taggedAs tag in
      test(new ColonnadeRays(config)).withAnnotations(Simulation.verilator) { dut =>
        val slow =
          new RayBatches(dut, config, stall = 60, maxDelay = 90, seed = 2).run(Seq(66, 1, 20, 10, 65, 1, 4, 66, 20))
        info(s"253 rays of a slow memory in $slow cycles")
        if (tag == Matrix) {
          val fast = new RayBatches(dut, config, stall = 0, maxDelay = 3, seed = 1).run(Seq(130, 64, 200, 1, 65, 100,
            200, 64, 330))
          info(s"1154 rays in $fast cycles")
        }
      }
}

/** Runs batches of all forms, refused ones and one that cannot be read among them. */
private class RayBatches(dut: ColonnadeRays, config: ColonnadeConfig, stall: Int, maxDelay: Int, seed: Int)
    extends Matchers {
  private val random   = new Random(seed)
  private val stimulus = new BatchStimulus(config, random)
  private val memory   = new RayMemory(dut.io.read, dut.io.write, random, stall, maxDelay)
  private val ringLog  = 2
  private val ringBase = BigInt(0x12340c0)
  private val tags     = BigInt(0x500000)
  private var cycles   = 0

  private val registers = RegisterMap(config)

  dut.clock.setTimeout(0)
  dut.reset.asBool.poke(true)
  dut.clock.step()
  dut.reset.asBool.poke(false)
  private val settings = stimulus.scene.registers ++
    new Packed(new RayPlacement).unpack(stimulus.placed.packed).map { case (name, value) =>
      s"placement.$name" -> value
    } ++
    Map("ring.base" -> ringBase, "ring.sizeLog" -> BigInt(ringLog))
  registers.filter(_.access == Access.ReadWrite).foreach(register => write(register, settings(register.name)))
  write(named("control.start"), 1)
  dut.io.load.valid.poke(true)
  for ((record, address) <- stimulus.scene.records.zipWithIndex) {
    dut.io.load.bits.address.poke(address)
    dut.io.load.bits.record.poke(record)
    dut.clock.step()
  }
  dut.io.load.valid.poke(false)
  dut.clock.step(2)

  private def named(name: String): Register = registers.find(_.name == name).get

  private def write(register: Register, value: BigInt): Unit = for (word <- 0 until register.words) {
    dut.io.register.write.poke(true)
    dut.io.register.address.poke(register.address + word)
    dut.io.register.writeData.poke((value >> (32 * word)) & 0xffffffffL)
    step()
    dut.io.register.write.poke(false)
  }

  private def read(name: String): BigInt = {
    dut.io.register.read.poke(true)
    dut.io.register.address.poke(named(name).address)
    step()
    dut.io.register.read.poke(false)
    dut.io.register.readData.peekInt()
  }

  private def step(): Unit = {
    memory.cycle()
    dut.clock.step()
    cycles += 1
    if (cycles > 60000) fail(s"no end after ${read("rays.head")} batches")
  }

  /** @param counts rays of each batch
    * @return cycles
    */
  def run(counts: Seq[Int]): Int = {
    val batches   = for ((count, i) <- counts.zipWithIndex) yield stimulus.batch(count, i % 3, form = i / 3)
    val expected  = Model.batches(config, stimulus.image, stimulus.scene.records, batches.map(_.query))
    val addresses = batches.indices.map(i => (BigInt(0x100f80) + i * 0x4000, BigInt(0x200fc0) + i * 0x4000))
    val refused   = 2 // an extra batch of an unknown mode, and one whose rays cannot be read
    val broken    = 4
    val illegal   = 7 // and one whose sensor is none
    var tail      = 0

    def submit(words: Seq[BigInt]): Unit = {
      while (((tail - read("rays.head").toInt) & 0xffff) >= (1 << ringLog) - 1) step()
      memory.store(ringBase + 64 * (tail % (1 << ringLog)), words)
      tail += 1
      write(named("rays.tail"), tail)
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
      if (i == illegal) {
        memory.store(rays + 0x3000, batch.rays.updated(9, BigInt(65)))
        submit(batch.words(rays + 0x3000, hits, 79, tags + 4 * 42))
      }
      submit(batch.words(rays, hits, 1000 + i, tags + 4 * i))
    }
    while (!dut.io.done.peekBoolean()) step()
    for (((batch, (_, hits)), hitWords) <- batches.zip(addresses).zip(expected)) withClue(s"$batch: ".take(80)) {
      memory.words(hits, batch.hitBytes / 4) shouldBe hitWords
      memory.words(hits + batch.hitBytes, 16).toSet shouldBe Set(BigInt(0x5a5a5a5a))
    }
    batches.indices.foreach(i => memory.words(tags + 4 * i, 1) shouldBe Seq(BigInt(1000 + i)))
    Seq(77 -> 40, 78 -> 41, 79 -> 42).foreach { case (tag, at) =>
      memory.words(tags + 4 * at, 1) shouldBe Seq(tag + RayBatch.errorBit)
    }
    memory.maxId shouldBe config.array.columns
    read("errors.batch") shouldBe 1
    read("errors.illegalRecord") shouldBe 0
    read("counters.rays") shouldBe batches.map(_.count).sum + batches(broken).count
    cycles
  }
}
