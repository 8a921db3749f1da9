package colonnade.query

import chisel3._
import chiseltest._
import colonnade.OneSimulation
import colonnade.TestParts._
import colonnade.axi.AxiMemory
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.collection.mutable
import scala.util.Random

private class RunReaderHarness extends MemoryUnit {
  private val reader = Module(new RunReader(RayConfigs.tiny)).io

  val batch     = IO(chiselTypeOf(reader.batch))
  val sensor    = IO(chiselTypeOf(reader.sensor))
  val runs      = IO(chiselTypeOf(reader.runs))
  val rays      = IO(chiselTypeOf(reader.rays))
  val record    = IO(Output(UInt(reader.rays.bits.record.getWidth.W)))
  val isLast    = IO(Output(Bool()))
  val hasFailed = IO(Output(Bool()))
  reader.batch   := batch
  reader.sensor  := sensor
  reader.context := 0.U
  reader.runs :<>= runs
  rays :<>= reader.rays
  record    := reader.rays.bits.record.asUInt
  isLast    := reader.isLast
  hasFailed := reader.hasFailed
  attach(read = Some(reader.axi))
}

/** Rays of runs are those of memory, or those of the sensor, in their order, whatever memory and taker do. */
class RunReaderSpec extends AnyFlatSpec with OneSimulation with Matchers {
  behavior of "RunReader"

  inOneSimulation(new RunReaderHarness)(
    "read rays"                  -> read(form = 0, stall = 50, accepted = 0.7),
    "read rays of a fan"         -> read(form = 1, stall = 50, accepted = 0.7),
    "make rays of a sensor"      -> read(form = 2, stall = 50, accepted = 0.7),
    "read while no ray is taken" -> read(form = 0, stall = 0, accepted = 0.1),
    "read while no ray is there" -> read(form = 1, stall = 70, accepted = 1)
  )

  /** @param form 0: rays, 1: a fan, 2: a sensor */
  private def read(form: Int, stall: Int, accepted: Double)(dut: RunReaderHarness): Unit = {
    val random = new Random(form)
    val memory = new AxiMemory(dut.pins, 64, random, stall)
    val sensor = TestSensor(random)
    val shared = Seq.fill(5)(BigInt(32, random)) // origin, tNear, tFar
    val flags  = Seq(8, 9, 10, 11).filter(_ => random.nextBoolean())
    val mode   = (flags ++ Seq(4, 5).slice(form - 1, form)).map(BigInt(1) << _).sum + random.nextInt(3)
    val bytes  = if (form == 1) 16 else 32
    dut.clock.setTimeout(0)
    sensor.poke(dut.sensor)
    FloatPorts.poke(dut.batch, mode, shared)

    // Runs that begin at any beat; some of their bursts fail
    case class Read(address: BigInt, count: Int, isTile: Boolean, dir: Seq[BigInt])
    val runs = Seq.tabulate(40) { run =>
      val isTile = form == 2 && random.nextBoolean()
      val count  = if (isTile || random.nextBoolean()) Run.rays else 1 + random.nextInt(Run.rays)
      Read(BigInt(0x200000 + 0x1000 * run + 64 * random.nextInt(32)), count, isTile, TestSensor(random).corner)
    }
    val failing = mutable.Set.empty[BigInt]
    val fails   = runs.map { run =>
      val beats  = run.address until run.address + run.count * bytes by 64
      val begins = beats.filter(at => at == run.address || at / 64 % Run.burstBeats == 0)
      val isBad  = form < 2 && random.nextInt(4) == 0
      if (isBad) failing += begins(random.nextInt(begins.size))
      isBad
    }
    memory.response = address => if (failing(address)) 2 else 0
    val expected = for ((run, number) <- runs.zipWithIndex; index <- 0 until run.count) yield {
      val words = Seq.fill(bytes / 4)(BigInt(32, random))
      memory.store(run.address + index * bytes, words)
      val (column, row) = TestSensor.positionOf(index, run.isTile)
      val record        = form match {
        case 0 => words
        case 1 => shared.take(4) ++ words
        case _ => shared.take(4) ++ TestSensor.floats(sensor.sum(run.dir, column, row)) :+ shared(4)
      }
      (record.zipWithIndex.map { case (word, i) => word << (32 * i) }.sum, index + 1 == run.count, number)
    }

    var (next, taken, cycles, hasFailed) = (0, 0, 0, false)
    while (taken < expected.size) {
      val offers = next < runs.size && random.nextInt(3) > 0
      dut.runs.valid.poke(offers)
      if (offers) {
        val run = runs(next)
        dut.runs.bits.rays.poke(run.address)
        dut.runs.bits.count.poke(run.count)
        dut.runs.bits.isTile.poke(run.isTile)
        run.dir.zip(dut.runs.bits.dir).foreach { case (from, to) => to.poke(from) }
      }
      val accepts = random.nextDouble() < accepted
      dut.rays.ready.poke(accepts)
      memory.cycle()
      if (dut.rays.valid.peekBoolean()) withClue(s"ray $taken, run ${runs(expected(taken)._3)}: ") {
        val (record, isLast, run) = expected(taken)
        if (!fails(run)) dut.record.peekInt() shouldBe record
        dut.isLast.peekBoolean() shouldBe isLast
        dut.rays.bits.isLocal.peekBoolean() shouldBe flags.contains(11)
        dut.rays.bits.isOccluded.peekBoolean() shouldBe (mode & 3) == 2
        val filter = dut.rays.bits.filter
        Seq(filter.cullsFront, filter.cullsBack, filter.refusesClear).map(_.peekBoolean()) shouldBe
          Seq(8, 9, 10).map(flags.contains)
        if (accepts) {
          hasFailed ||= dut.hasFailed.peekBoolean()
          if (isLast) {
            hasFailed shouldBe fails(run)
            hasFailed = false
          }
          taken += 1
        }
      }
      if (offers && dut.runs.ready.peekBoolean()) next += 1
      dut.clock.step()
      cycles += 1
      cycles should be < 40000
    }
    dut.runs.valid.poke(false)
    dut.rays.ready.poke(true)
    for (_ <- 0 until 100) {
      memory.cycle()
      dut.rays.valid.expect(false)
      dut.clock.step()
    }
    memory.isIdle shouldBe true
    if (form == 2) memory.read shouldBe empty
    else memory.read.map(_ / 64 * 64).toSet shouldBe runs.flatMap(run =>
      run.address until run.address + run.count * bytes by 64
    ).toSet
  }
}
