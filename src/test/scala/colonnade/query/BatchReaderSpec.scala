package colonnade.query

import chisel3._
import chiseltest._
import colonnade.OneSimulation
import colonnade.axi.AxiMemory
import colonnade.formats.RayBatch
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.collection.mutable
import scala.util.Random

private class BatchReaderHarness(columns: Int) extends MemoryUnit {
  private val reader = Module(new BatchReader(columns)).io

  val ring     = IO(chiselTypeOf(reader.ring))
  val tail     = IO(chiselTypeOf(reader.tail))
  val head     = IO(chiselTypeOf(reader.head))
  val start    = IO(Output(Bool()))
  val runs     = IO(chiselTypeOf(reader.runs))
  val resolved = IO(chiselTypeOf(reader.resolved))
  val failed   = IO(Input(Bool()))
  val isError  = IO(Output(Bool()))
  val raysDone = IO(Output(UInt(32.W)))
  val isBusy   = IO(Output(Bool()))
  reader.ring     := ring
  reader.tail     := tail
  reader.resolved := resolved
  reader.failed   := failed
  head            := reader.head
  start           := reader.start
  runs :<>= reader.runs
  isError  := reader.isError
  raysDone := reader.raysDone
  isBusy   := reader.isBusy
  attach(Some(reader.read), Some(reader.write))
}

/** Batches of a ring are handed out as their runs, each ray once; each legal or illegal one ends as its tag says. */
class BatchReaderSpec extends AnyFlatSpec with OneSimulation with Matchers {
  behavior of "BatchReader"

  private val columns = 2

  inOneSimulation(new BatchReaderHarness(columns))(
    "hand out rays, fans and sensors"   -> (dut => new BatchBench(dut, columns, stall = 50, seed = 1).run(legal(1))),
    "without stalls"                    -> (dut => new BatchBench(dut, columns, stall = 0, seed = 2).run(legal(2))),
    "refuse what is illegal, and go on" -> (dut => new BatchBench(dut, columns, stall = 30, seed = 3).run(illegal)),
    "take batches of the most rays"     -> begin(RayBatch.maxCount, columns = 64, isLegal = true),
    "take no larger ones"               -> begin(RayBatch.maxCount + 1, columns = 64, isLegal = false),
    "take sensors of the most columns"  -> begin(64, columns = RayBatch.maxCount, isLegal = true),
    "take no wider ones"                -> begin(64, columns = RayBatch.maxCount + 64, isLegal = false)
  )

  /** Of all forms and responses; of sensors some have whole tiles, a row more, and parts of one. Some fail. */
  private def legal(seed: Int): Seq[ReadBatch] = {
    val random = new Random(seed)
    for (index <- 0 until 36) yield {
      val form  = index / 3 % 3
      val width = 64 * (1 + random.nextInt(3))
      val count =
        if (form == 2) width * random.nextInt(10) + (if (random.nextBoolean()) 0 else random.nextInt(width)) + 1
        else Seq(1, 64, 65, 1 + random.nextInt(400))(random.nextInt(4))
      ReadBatch(
        mode = (BigInt(random.nextInt(256)) << 24) + index % 3 + (if (form == 0) 0 else 8 << form),
        count = count,
        sensor = TestSensor(random).copy(columns = width),
        hasTag = random.nextInt(5) > 0,
        fails = random.nextInt(4) == 0
      )
    }
  }

  /** A wrong field each, between batches of one run. */
  private def illegal: Seq[ReadBatch] = {
    val fine   = ReadBatch(mode = 1, count = 64)
    val sensor = fine.copy(mode = 0x20)
    val modes  =
      Seq(3, 0x30, 4, 8, 0x40, 0x80, 0x1000, 0x100000, 0x800000).map(bits => fine.copy(mode = bits, isLegal = false))
    val fields = Seq(
      fine.copy(count = 0),
      fine.copy(count = BigInt(1) << 31),
      fine.copy(raysOffset = 32),
      fine.copy(hitsOffset = 8),
      fine.copy(raysOffset = BigInt(1) << 40),
      fine.copy(hitsOffset = BigInt(1) << 63)
    ) ++ Seq(BigInt(0), BigInt(65), BigInt(32)).map(columns =>
      sensor.copy(sensor = sensor.sensor.copy(columns = columns))
    ) ++
      Seq(sensor.copy(isSensorUnread = true))
    val refused = (modes ++ fields).map(_.copy(isLegal = false))
    val tagless = Seq(BigInt(1), BigInt(2), BigInt(1) << 40).map(offset =>
      fine.copy(isLegal = false, hasTag = false, doneOffset = offset)
    )
    val untagged = refused.take(2).map(_.copy(hasTag = false))
    val unread   = Seq(fine.copy(isUnread = true, isLegal = false, hasTag = false), fine.copy(isTagLost = true))
    (refused ++ tagless ++ untagged ++ unread).flatMap(Seq(_, fine))
  }

  /** The first runs of a batch too large to end. */
  private def begin(count: BigInt, columns: BigInt, isLegal: Boolean)(dut: BatchReaderHarness): Unit = {
    val sensor = TestSensor(new Random(4)).copy(columns = columns)
    val batch  = ReadBatch(mode = 0x20, count = count, sensor = sensor, isLegal = isLegal)
    val bench  = new BatchBench(dut, this.columns, stall = 20, seed = 5)
    if (isLegal) bench.begin(batch, runs = 12) else bench.run(Seq(batch))
  }
}

/** A batch in memory, and what becomes of it. */
private final case class ReadBatch(
    mode:           BigInt,
    count:          BigInt,
    sensor:         TestSensor = TestSensor(new Random(6)),
    hasTag:         Boolean = true,
    raysOffset:     BigInt = 0,
    hitsOffset:     BigInt = 0,
    doneOffset:     BigInt = 0,
    isLegal:        Boolean = true,
    fails:          Boolean = false,
    isUnread:       Boolean = false,
    isSensorUnread: Boolean = false,
    isTagLost:      Boolean = false
) {
  private val response = (mode & 3).toInt
  val isSensor: Boolean = mode.testBit(5)

  /** Rays (none of a sensor), hits, count, direction (of a sensor alone), tile. */
  type HandedOut = (Option[BigInt], BigInt, Int, Option[Seq[BigInt]], Boolean)

  def runs(rays: BigInt, hits: BigInt): Iterator[HandedOut] = {
    val hitBytes = Seq(16, 8)(response.min(1))
    val wide     = sensor.columns
    if (!isSensor || response == 2) Iterator.iterate(BigInt(0))(_ + 64).takeWhile(_ < count).map { first =>
      val to  = hits + (if (response == 2) first / 8 else first * hitBytes)
      val dir = Option.when(isSensor)(sensor.sum(sensor.corner, first % wide, first / wide))
      (
        Option.unless(isSensor)(rays + first * (if (mode.testBit(4)) 16 else 32)),
        to,
        (count - first).min(64).toInt,
        dir,
        false
      )
    }
    else {
      val bands = count / (4 * wide)
      val tiles = for (
        band <- Iterator.iterate(BigInt(0))(_ + 1).takeWhile(_ < bands);
        tile <- Iterator.iterate(BigInt(0))(_ + 16).takeWhile(_ < wide)
      )
        yield (
          None,
          hits + (band * 4 * wide + tile) * hitBytes,
          64,
          Some(sensor.sum(sensor.corner, tile, 4 * band)),
          true
        )
      val rest = Iterator.iterate(bands * 4 * wide)(_ + 64).takeWhile(_ < count).map { first =>
        (
          None,
          hits + first * hitBytes,
          (count - first).min(64).toInt,
          Some(sensor.sum(sensor.corner, first % wide, first / wide)),
          false
        )
      }
      tiles ++ rest
    }
  }
}

private class BatchBench(dut: BatchReaderHarness, columns: Int, stall: Int, seed: Int) extends Matchers {
  private val random   = new Random(seed)
  private val memory   = new AxiMemory(dut.pins, RayBatch.bytes, random, stall)
  private val ringLog  = 2
  private val ring     = BigInt(0x3fc0)
  private val failing  = mutable.Set.empty[BigInt] // bursts
  private var errors   = 0
  private var raysDone = BigInt(0)
  private var open     = 0                         // runs that are under way

  dut.clock.setTimeout(0)
  dut.ring.base.poke(ring)
  dut.ring.sizeLog.poke(ringLog)
  memory.response = address => if (failing(address)) 2 else 0

  private def rays(index: Int) = BigInt(0x100000) + 0x1000 * index
  private def hits(index: Int) = (BigInt(1) << 39) + 0x10000 * index
  private def done(index: Int) = BigInt(0x8000) + 68 * index

  /** Lays out a batch and moves the tail, when the ring has space for it. */
  private def submit(batch: ReadBatch, index: Int): Unit = {
    val slot     = ring + 64 * (index % (1 << ringLog))
    val tag      = done(index) + batch.doneOffset
    val base     = TestBatch(batch.mode, 0, Seq.fill(5)(BigInt(0)), Nil)
    val isTagged = batch.hasTag || batch.doneOffset > 0
    memory.store(
      slot,
      base.words(
        rays(index) + batch.raysOffset,
        hits(index) + batch.hitsOffset,
        100 + index,
        if (isTagged) tag else 0
      ).updated(4, batch.count)
    )
    memory.store(rays(index), batch.sensor.words)
    memory.store(done(index), Seq(BigInt(7)))
    if (batch.isUnread) failing += slot else failing -= slot
    if (batch.isSensorUnread) failing += rays(index)
    if (batch.isTagLost) failing += done(index) / 64 * 64
    dut.tail.poke(index + 1)
  }

  /** A cycle; returns the run that is taken. */
  private def cycle(accepts: Boolean, fails: Boolean = false): Option[ReadBatch#HandedOut] = {
    dut.runs.ready.poke(accepts)
    val ends = if (random.nextInt(4) == 0) random.nextInt(open.min(2 * columns) + 1) else 0
    dut.resolved.poke(ends)
    dut.failed.poke(fails && ends > 0)
    memory.cycle()
    val run   = dut.runs.bits
    val taken = Option.when(accepts && dut.runs.valid.peekBoolean())(
      (
        Some(run.rays.peekInt()),
        run.hits.peekInt(),
        run.count.peekInt().toInt,
        Some(run.dir.map(_.peekInt())),
        run.isTile.peekBoolean()
      )
    )
    open += taken.size - ends
    if (dut.isError.peekBoolean()) errors += 1
    raysDone += dut.raysDone.peekInt()
    dut.clock.step()
    taken
  }

  private def check(found: ReadBatch#HandedOut, expected: ReadBatch#HandedOut): Unit = {
    val (rays, hits, count, dir, isTile) = expected
    (
      rays.map(_ => found._1.get),
      found._2,
      found._3,
      dir.map(_ => found._4.get),
      found._5
    ) shouldBe ((rays, hits, count, dir, isTile))
  }

  def begin(batch: ReadBatch, runs: Int): Unit = {
    submit(batch, 0)
    val expected = batch.runs(rays(0), hits(0)).take(runs)
    for (_ <- 0 until 40 * runs; found <- cycle(accepts = expected.hasNext)) check(found, expected.next())
    expected.hasNext shouldBe false
    errors shouldBe 0
  }

  def run(batches: Seq[ReadBatch]): Unit = {
    val last                       = batches.size
    var (submitted, index, cycles) = (0, 0, 0)
    var expected                   = Iterator.empty[ReadBatch#HandedOut]
    while (index < last || submitted < last) {
      if (submitted < last && submitted - index < (1 << ringLog) - 1 && random.nextInt(8) == 0) {
        submit(batches(submitted), submitted)
        submitted += 1
      }
      val batch = batches(index)
      if (dut.start.peekBoolean()) {
        batch.isLegal shouldBe true
        expected.hasNext shouldBe false
        expected = batch.runs(rays(index), hits(index))
      }
      val fails = batch.fails && !expected.hasNext
      cycle(accepts = random.nextBoolean(), fails).foreach(check(_, expected.next()))
      if (open > 0 || expected.hasNext) memory.written should not contain done(index)
      val head = dut.head.peekInt().toInt
      if (head > index) {
        head shouldBe index + 1
        withClue(s"batch $index, $batch: ") {
          expected.hasNext shouldBe false
          open shouldBe 0
          val hasError = !batch.isLegal || batch.fails
          memory.words(done(index), 1).head shouldBe
            (if (batch.hasTag) 100 + index + (if (hasError) RayBatch.errorBit else BigInt(0)) else BigInt(7))
        }
        index = head
      }
      cycles += 1
      cycles should be < 60000
      if (index == last) for (_ <- 0 until 20) cycle(accepts = true) shouldBe empty
    }
    errors shouldBe batches.count(batch => !batch.isLegal || batch.fails || batch.isTagLost)
    raysDone shouldBe batches.filter(_.isLegal).map(_.count).sum
    dut.isBusy.expect(false)
    memory.isIdle shouldBe true
    memory.written shouldBe batches.indices.filter(batches(_).hasTag).flatMap(i => (0 until 4).map(done(i) + _)).toSet
  }
}
