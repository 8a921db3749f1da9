package colonnade.query

import chisel3._
import chiseltest._
import colonnade.TestParts._
import colonnade.config.ColonnadeConfig
import colonnade.formats.{HitRecord, RayPlacement}
import colonnade.{Model, Packed, PackedStreams, PackedUnit, Simulation}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.util.Random

private class HitConverterHarness(config: ColonnadeConfig)
    extends PackedUnit(new TracedHit(config), new HitRecord) {
  private val converter = Module(new HitConverter(config)).io

  val placement = IO(Input(UInt((new RayPlacement).getWidth.W)))
  converter.placement := placement.asTypeOf(new RayPlacement)
  connect(converter.hits, converter.records)
}

/** Hits as floats equal the model's, bit for bit, over all exponents; misses have the t of their rays. */
class HitConverterSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "HitConverter"

  for (config <- RayConfigs.formats)
    it should s"equal the model under random stalls, ${RayConfigs.nameOf(config)}" in
      test(new HitConverterHarness(config)).withAnnotations(Simulation.verilator) { dut =>
        val random   = new Random(6)
        val stimulus = new RayStimulus(config, random)
        val traced   = new Packed(new TracedHit(config))
        val record   = new Packed(new HitRecord)
        val results  = for (round <- 0 until 24) yield {
          val any     = stimulus.placement()
          val placed  = if (round % 3 == 0) any.copy(mantissa = BigInt(1) << 23) else any
          val hits    = Seq.fill(30)(new RandomHit(config, stimulus, random))
          val queries = hits.map(hit => placed.scale ++ Seq(hit.dominant, hit.entry, hit.t) ++ hit.weights)
          dut.placement.poke(placed.packed)
          val (records, _) = PackedStreams.run(dut, hits.map(hit => traced.pack(hit.fields)), 0.7, 0.6, random)
          for (((bits, hit), reply) <- records.zip(hits).zip(Model.answers(config, queries, "hit")))
            yield withClue(s"$placed, ${hit.fields}: ") {
              val found = record.unpack(bits)
              Seq("t", "id", "u", "v").map(wordOf(found, _)) shouldBe hit.expected(reply)
              reply.head.toInt
            }
        }
        val times = results.flatten
        info(s"${times.count(_ == 0)} of t = 0, ${times.count(_ == 0x7f800000)} infinite, ${times.size} in all")
        times.distinct.size should be > times.size / 2
        times should contain allOf (0, 0x7f800000)
      }

  private def wordOf(record: Map[String, BigInt], name: String): BigInt =
    record.getOrElse(
      name,
      (record(s"$name.isNegative") << 31) + (record(s"$name.biased") << 23) + record(s"$name.fraction")
    )
}

/** A hit, or a miss, with a quotient between two floats now and then. */
private class RandomHit(config: ColonnadeConfig, stimulus: RayStimulus, random: Random) {
  private val numbers = config.numbers

  private val isEven = random.nextInt(3) == 0
  val dominant: BigInt = {
    val float = LazyList.continually(stimulus.any() & 0x7fffffff).find(x => x >= 0x800000 && x < 0x7f800000).get
    if (isEven) float & 0x7f800000 else float
  }

  /** With a scale that is a power of two 25 digits lie between two floats. */
  val (entry: BigInt, t: BigInt) = {
    val fraction = numbers.gridFraction
    val finest   = (-fraction).max(0)
    if (isEven && fraction > 0)
      ((BigInt(1) << (24 - fraction)) + BigInt(24 - fraction, random), BigInt(fraction, random).setBit(0))
    else ((number(numbers.vertexBits + 5) >> finest) << finest, number(numbers.gridBits - 1))
  }

  val weights: Seq[BigInt] = {
    val all = BigInt(1) << (numbers.weightBits - 2)
    val one = number(numbers.weightBits - 2)
    random.shuffle(Seq(one, all - one, BigInt(numbers.weightBits - 2, random)))
  }
  private val hasHit     = random.nextInt(4) != 0
  private val hasWeights = random.nextInt(3) != 0
  private val isTooFar   = random.nextInt(4) == 0
  private val id         = BigInt(10, random)
  private val flags      = Seq.fill(2)(BigInt(random.nextInt(2)))
  private val tFar       = stimulus.any()

  def fields: Map[String, BigInt] =
    float("scale.dominant", dominant) ++ float("scale.tFar", tFar) ++
      weights.zipWithIndex.map { case (weight, i) => s"hit.weights[$i]" -> weight } ++
      Map(
        "scale.isOutOfRange" -> bit(isTooFar),
        "hasHit"             -> bit(hasHit),
        "hasWeights"         -> bit(hasWeights),
        "tEntry"             -> entry,
        "hit.t"              -> t,
        "hit.id"             -> id,
        "hit.backSide"       -> flags.head,
        "isClear"            -> flags.last
      )

  /** t, id, u, v as words, from the model's t, u, v. */
  def expected(reply: Seq[BigInt]): Seq[BigInt] =
    if (!hasHit) Seq(tFar, if (isTooFar) HitRecord.outOfRange else HitRecord.miss, 0, 0)
    else {
      val flagged = id + flags.head * HitRecord.backSide + flags.last * HitRecord.clear
      Seq(reply.head, flagged) ++ (if (hasWeights) reply.tail else Seq(BigInt(0), BigInt(0)))
    }

  /** Of up to so many bits, with a few ones, zeros, or any digits at the end. */
  private def number(bits: Int): BigInt = {
    val any = BigInt(random.nextInt(bits + 1), random)
    if (random.nextBoolean()) (((any >> 3) << 3) + 4).min((BigInt(1) << bits) - 1) else any
  }

  private def float(name: String, word: BigInt): Map[String, BigInt] =
    Map(
      s"$name.isNegative" -> (word >> 31),
      s"$name.biased"     -> (word >> 23 & 0xff),
      s"$name.fraction"   -> (word & 0x7fffff)
    )

  private def bit(flag: Boolean): BigInt = BigInt(if (flag) 1 else 0)
}
