package colonnade.traversal

import chisel3._
import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.Packed
import colonnade.formats.{Leaf, LeafRecord}
import colonnade.numbers.Fixed
import org.scalatest.matchers.should.Matchers

/** A leaf's triangles with their ray: one, or a pair. */
final case class TestCandidate(context: Int, address: Int, ray: TestRay, triangles: Seq[TestTriangle])

/** One result: of which candidate, whether it is its last, and the hit. */
final case class ExpectedResult(candidate: TestCandidate, index: Int, isLast: Boolean, hit: ExpectedHit)

/** Drives a [[TriangleUnit]] and holds it against the model. */
final class TriangleHarness(config: ColonnadeConfig, stimulus: TriangleStimulus) extends Matchers {
  private val flatPair = new Packed(LeafRecord.flatPair(config.geometry))

  /** Results in order, by the model. */
  def expected(candidates: Seq[TestCandidate]): Seq[ExpectedResult] = {
    val hits = stimulus.expected(candidates.flatMap(c => c.triangles.map((c.ray, _)))).iterator
    candidates.flatMap(c => c.triangles.indices.map(k => ExpectedResult(c, k, k == c.triangles.size - 1, hits.next())))
  }

  /** Random candidates. */
  def random(count: Int): Seq[TestCandidate] = Seq.fill(count) {
    val (ray, triangles) = stimulus.meeting(1 + stimulus.nextInt(Leaf.maxTriangles))
    candidate(ray, triangles)
  }

  def candidate(ray: TestRay, triangles: Seq[TestTriangle]): TestCandidate =
    TestCandidate(
      stimulus.nextInt(config.array.contexts),
      stimulus.nextInt(config.columnBvhMemory.depth),
      ray,
      triangles
    )

  /** Sends all candidates and checks all results.
    *
    * @param bubbles one in so many cycles offers nothing, 0: never
    * @param stalls  one in so many cycles accepts results only, 0: always
    * @return cycles from the first candidate to the last result, and how many triangles were hit
    */
  def run(unit: TriangleUnit, candidates: Seq[TestCandidate], bubbles: Int, stalls: Int): (Int, Int) = {
    val awaited                  = expected(candidates)
    val limit                    = 200 + awaited.size * 40 * stalls.max(1)
    var (sent, received, cycles) = (0, 0, 0)
    var isOffered                = false
    var isPromised               = unit.io.candidate.ready.peekBoolean()
    unit.clock.setTimeout(0)
    while (received < awaited.size) {
      withClue(s"after $received of ${awaited.size} results: ")(cycles should be < limit)
      if (!isOffered && sent < candidates.size && (bubbles == 0 || !stimulus.chance(bubbles))) {
        poke(unit.io.candidate.bits, candidates(sent))
        isOffered = true
      }
      unit.io.candidate.valid.poke(isOffered.B)
      val accepts = stalls == 0 || stimulus.chance(stalls)
      unit.io.result.ready.poke(accepts.B)
      if (accepts && unit.io.result.valid.peekBoolean()) {
        check(unit.io.result.bits, awaited(received))
        received += 1
      }
      unit.io.candidate.ready.expect(isPromised.B)
      isPromised = unit.io.readyNext.peekBoolean()
      if (isOffered && unit.io.candidate.ready.peekBoolean()) {
        sent += 1
        isOffered = false
      }
      unit.clock.step()
      cycles += 1
    }
    unit.io.candidate.valid.poke(false.B)
    unit.io.result.ready.poke(true.B)
    sent shouldBe candidates.size
    for (_ <- 0 until 80) {
      unit.io.result.valid.expect(false.B)
      unit.clock.step()
    }
    (cycles, awaited.count(_.hit.isHit))
  }

  private def check(result: TriangleResult, expected: ExpectedResult): Unit = withClue(s"$expected: ") {
    result.context.peekInt() shouldBe expected.candidate.context
    result.isLast.peekBoolean() shouldBe expected.isLast
    result.isHit.peekBoolean() shouldBe expected.hit.isHit
    if (expected.hit.isHit) {
      val hit = result.hit
      (peek(hit.t), hit.weights.map(peek), hit.backSide.peekBoolean()) shouldBe
        ((expected.hit.t, expected.hit.weights, expected.hit.backSide))
      hit.id.peekInt() shouldBe Leaf.maxTriangles * expected.candidate.address + expected.index
    }
  }

  def poke(bits: TriangleCandidate, candidate: TestCandidate): Unit = {
    val ray = bits.ray
    bits.context.poke(candidate.context.U)
    bits.address.poke(candidate.address.U)
    // A triangle has its vertices where a flat pair has its first three
    val vertices = candidate.triangles.head.vertices ++ candidate.triangles.tail.map(_.vertices.last)
    val values   = for ((vertex, i) <- vertices.zipWithIndex; (value, axis) <- vertex.zip("xyz"))
      yield s"body.vertices[$i].$axis" -> value
    bits.record.poke(flatPair.pack(values.toMap + ("format" -> BigInt(if (candidate.triangles.size == 1) 1 else 2))))
    ray.orientation.axis.poke(candidate.ray.axis.U)
    ray.orientation.negative.zip(candidate.ray.negative).foreach { case (port, value) => port.poke(value.B) }
    ray.origin.zip(candidate.ray.origin).foreach { case (port, value) => poke(port, value) }
    ray.shear.zip(candidate.ray.shear).foreach { case (port, value) => poke(port, value) }
  }

  private def poke(port: Fixed, value: BigInt): Unit = port.raw match {
    case signed: SInt   => signed.poke(value.S)
    case unsigned: UInt => unsigned.poke(value.U)
    case other          => fail(s"a raw number of type $other")
  }

  def peek(port: Fixed): BigInt = port.raw match {
    case signed: SInt   => signed.peekInt()
    case unsigned: UInt => unsigned.peekInt()
    case other          => fail(s"a raw number of type $other")
  }
}
