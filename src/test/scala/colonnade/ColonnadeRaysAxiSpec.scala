package colonnade

import chiseltest._
import colonnade.bus.ShellMap
import colonnade.config.{ColonnadeConfig, ShellConfig}
import colonnade.formats.{Access, RayBatch, RayPlacement, RegisterMap}
import colonnade.query.{BatchStimulus, RayConfigs, TestBatch}
import org.scalatest.Tag
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.util.Random

/** Hits of batches equal the model's byte for byte, whatever the memory does and other batches ask for. */
class ColonnadeRaysAxiSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "ColonnadeRaysAxi"

  private val tiny  = RayConfigs.tiny
  private val small = tiny.copy(
    array = tiny.array.copy(rows = 2, columns = 2, contexts = 8),
    units = tiny.units.copy(triangleRows = 2)
  )

  check("tiny", tiny, Always)
  check("two columns of two rows", small, Matrix)
  check("24-bit vertices", RayConfigs.withVertices(24, 32), Matrix)

  private def check(name: String, config: ColonnadeConfig, tag: Tag): Unit =
    it should s"give the hits of the model, also after hostile batches and soft resets, $name" taggedAs tag in
      test(new ColonnadeRaysAxi(config, RayBatches.shell)).withAnnotations(Simulation.verilator) { dut =>
        val slow = new RayBatches(dut, config, stall = 60, maxDelay = 90, seed = 2)
        info(s"207 rays of a slow memory in ${slow.run(Seq(66, 1, 20, 10, 65, 1, 4, 20, 20))} cycles")
        slow.refuses()
        slow.fuzz(if (tag == Matrix) 1000 else 4)
        if (tag == Matrix) {
          val fast = new RayBatches(dut, config, stall = 0, maxDelay = 3, seed = 1)
          info(s"1854 rays in ${fast.run(Seq(130, 64, 200, 1, 65, 100, 900, 64, 330))} cycles")
        }
      }
}

/** Runs batches of all forms, refused ones and one that cannot be read among them. */
private class RayBatches(dut: ColonnadeRaysAxi, config: ColonnadeConfig, stall: Int, maxDelay: Int, seed: Int)
    extends ShellBench(dut, config, RayBatches.shell, new Random(seed), stall)
    with Matchers {
  private val stimulus = new BatchStimulus(config, random)
  private val window   = (BigInt(0x100f80), BigInt(0x500340))
  private val ringLog  = 2
  private val ringBase = BigInt(0x4000c0)
  private val tags     = BigInt(0x500000)
  private var tail     = 0
  private var cycles   = 0
  private val settings = stimulus.scene.registers ++
    new Packed(new RayPlacement).unpack(stimulus.placed.packed).map { case (name, value) =>
      s"placement.$name" -> value
    } ++
    Map("ring.base" -> ringBase, "ring.sizeLog" -> BigInt(ringLog))

  memory.maxDelay = maxDelay
  dut.reset.asBool.poke(true)
  cycle()
  dut.reset.asBool.poke(false)
  load(image(stimulus.scene.records)) shouldBe Set()
  begin()

  override def cycle(): Unit = {
    super.cycle()
    cycles += 1
    if (cycles > 60000) fail(s"no end, $tail batches")
  }

  /** After a reset: all registers. */
  private def begin(): Unit = {
    host.set("rays.windowBase", window._1)
    host.set("rays.windowEnd", window._2)
    RegisterMap(config).filter(_.access == Access.ReadWrite).foreach(each => write(each.name, settings(each.name)))
    write("control.start", 1)
    tail = 0
    cycles = 0
  }

  private def submit(words: Seq[BigInt]): Unit = {
    while (((tail - read("rays.head").toInt) & 0xffff) >= (1 << ringLog) - 1) cycle()
    memory.store(ringBase + 64 * (tail % (1 << ringLog)), words)
    tail += 1
    write("rays.tail", tail)
  }

  private def finish(): Unit = while (host("status") != 0) cycle()

  private def tag(at: Int): BigInt = memory.words(tags + 4 * at, 1).head

  /** The hits are those of the model, and no others are written. */
  private def check(batch: TestBatch, hits: BigInt, expected: Seq[BigInt]): Unit =
    withClue(s"${batch.count} rays, mode ${batch.mode.toString(16)}: ") {
      memory.words(hits, batch.hitBytes / 4) shouldBe expected
      memory.words(hits + batch.hitBytes, 16).toSet shouldBe Set(RayBatches.unwritten)
    }

  private def store(batch: TestBatch, rays: BigInt, hits: BigInt): Unit = {
    memory.store(rays, batch.rays)
    memory.store(hits, Seq.fill(batch.hitBytes / 4 + 16)(RayBatches.unwritten))
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

    for ((batch, i) <- batches.zipWithIndex) {
      val (rays, hits) = addresses(i)
      store(batch, rays, hits)
      if (i == refused) submit(batch.copy(mode = batch.mode | 4).words(rays, hits, 77, tags + 4 * 40))
      if (i == broken) {
        memory.response = address => if (address == rays + 0x3000) 2 else 0
        submit(batch.words(rays + 0x3000, hits, 78, tags + 4 * 41))
      }
      if (i == illegal) {
        memory.store(rays + 0x3000, batch.rays.updated(9, BigInt(65)))
        submit(batch.words(rays + 0x3000, hits, 79, tags + 4 * 42))
      }
      submit(batch.words(rays, hits, 1000 + i, tags + 4 * i))
    }
    finish()
    for (((batch, (_, hits)), hitWords) <- batches.zip(addresses).zip(expected)) check(batch, hits, hitWords)
    batches.indices.foreach(i => tag(i) shouldBe 1000 + i)
    Seq(77 -> 40, 78 -> 41, 79 -> 42).foreach { case (name, at) => tag(at) shouldBe name + RayBatch.errorBit }
    read("errors.batch") shouldBe 1
    read("errors.illegalRecord") shouldBe 0
    read("counters.rays") shouldBe batches.map(_.count).sum + batches(broken).count
    until("frameDone") shouldBe Set("frameDone", "error")
    cycles
  }

  /** While a batch runs, the tail alone can be written. */
  def refuses(): Unit = {
    val batch         = stimulus.batch(1, 0, form = 0)
    def words(i: Int) = batch.words(window._1, 0x200fc0, 5 + i, tags + 4 * i)
    memory.store(window._1, batch.rays)
    Seq(1, 3).foreach(command => host.write(0x40, command) shouldBe false) // no frame, nor two commands
    memory.isSilent = true
    submit(words(0))
    host("status") shouldBe 1
    host.write(0x40, 2) shouldBe false // no image
    host.write(0x178, 0) shouldBe false
    for (name <- Seq("ring.base", "control.start"))
      host.write(ShellMap.deviceBase + 4 * RegisterMap(config).find(_.name == name).get.address, 1) shouldBe false
    host.read(0x80)._2 shouldBe false // no framebuffer
    submit(words(1))
    memory.isSilent = false
    finish()
    tag(1) shouldBe 6
    until("frameDone") shouldBe Set("frameDone")
  }

  /** Hostile batches, of which a soft reset ends some at any cycle. Later ones have the hits of the model, and nothing
    * is written beyond the window.
    */
  def fuzz(rounds: Int): Unit = {
    val batches  = Seq.tabulate(rounds)(i => stimulus.batch(1 + random.nextInt(80), i % 3, i / 3 % 3))
    val expected = Model.batches(config, stimulus.image, stimulus.scene.records, batches.map(_.query))
    val rays     = BigInt(0x110000)
    val hits     = BigInt(0x210000)
    for ((batch, round) <- batches.zipWithIndex) {
      memory.store(tags, Seq.fill(4)(RayBatches.unwritten))
      store(stimulus.batch(80, 0, form = 0), rays, hits)
      val hostile = Seq.tabulate(3)(i => new HostileBatch(batches(random.nextInt(rounds)), random, window, i))
      hostile.foreach(each => submit(each.words(rays, hits, tags)))
      val isCut = random.nextBoolean()
      if (isCut) {
        for (_ <- 0 until random.nextInt(600)) cycle()
        host.set("control", 4)
      }
      finish()
      if (isCut) {
        memory.isIdle shouldBe true
        begin()
      } else {
        for ((each, i) <- hostile.zipWithIndex; left <- each.tag(rays, hits)) withClue(each) { tag(i) shouldBe left }
      }
      store(batch, rays, hits)
      submit(batch.words(rays, hits, 1000, tags + 16))
      finish()
      tag(4) shouldBe 1000
      withClue(s"after ${hostile.mkString("; ")}${if (isCut) ", cut" else ""}: ")(check(batch, hits, expected(round)))
      memory.written.filterNot(at => at >= window._1 && at < window._2) shouldBe Set()
      cycles = 0
    }
  }
}

private object RayBatches {
  val shell:     ShellConfig = ShellConfig(RayBatch.bytes)
  val unwritten: BigInt      = BigInt(0x5a5a5a5a)
}

/** A batch of whose descriptor one or two fields are wrong, or nearly so. */
private class HostileBatch(batch: TestBatch, random: Random, window: (BigInt, BigInt), index: Int) {
  private val wide   = Seq(BigInt(64, random), BigInt(40, random), window._1 - 64, window._2, window._2 - 64, BigInt(0))
  private val counts = Seq(BigInt(0), RayBatch.maxCount + 1, BigInt(1) << 31, BigInt(1))
  private val wrong  = Seq.fill(1 + random.nextInt(2))(random.nextInt(6)).toSet
  private val value  = wide(random.nextInt(wide.size)) + (if (random.nextInt(4) == 0) 1 << random.nextInt(6) else 0)
  private val count  = if (wrong(3)) counts(random.nextInt(counts.size)) else BigInt(batch.count)
  private val mode   = if (wrong(4)) batch.mode ^ (BigInt(1) << random.nextInt(32)) else batch.mode

  private def rays(at: BigInt) = if (wrong(0)) value else at
  private def hits(at: BigInt) = if (wrong(1)) value else at
  private def done(at: BigInt) = if (wrong(2)) value else at + 4 * index

  def words(rays: BigInt, hits: BigInt, tags: BigInt): Seq[BigInt] = {
    val shared = if (wrong(5)) batch.shared.map(_ => BigInt(32, random)) else batch.shared
    batch.copy(mode = mode, shared = shared).words(this.rays(rays), this.hits(hits), index, done(tags))
      .updated(4, count)
  }

  /** The tag that it leaves, if its place is the one that was meant, and it needs no sensor. */
  def tag(rays: BigInt, hits: BigInt): Option[BigInt] = Option.unless(wrong(2) || mode.testBit(5)) {
    val isLegal                         = (mode & 3) != 3 && (mode & ~BigInt("ff000f13", 16)) == 0
    val taken                           = count * (if (mode.testBit(4)) 16 else 32)
    val answers                         = (count * Seq(128, 64, 1)((mode & 3).toInt.min(2)) + 7) / 8
    def fits(at: BigInt, bytes: BigInt) = at % 64 == 0 && at >= window._1 && at + (bytes + 63) / 64 * 64 <= window._2
    val isFine = isLegal && count > 0 && count <= RayBatch.maxCount && fits(this.rays(rays), taken) &&
      fits(this.hits(hits), answers)
    if (isFine) index else index + RayBatch.errorBit
  }

  override def toString: String = s"batch $index, wrong fields $wrong, mode ${mode.toString(16)}, count $count, $value"
}
