package colonnade

import org.scalacheck.rng.Seed
import org.scalacheck.{Prop, Test}
import org.scalatest.Assertions
import org.scalatest.exceptions.TestFailedException
import org.scalatestplus.scalacheck.Checkers

/** Properties of arbitrary values, other ones each time. A failure names its seed; in the environment variable
  * `PROPERTY_SEED` it brings the same values back.
  */
trait Properties extends Checkers { this: Assertions =>

  protected def holds(cases: Int)(property: Prop): Unit = {
    val seed = sys.env.get("PROPERTY_SEED").fold(Seed.random())(Seed.fromBase64(_).get)
    // The failure is told by its text: with the values in it, it could not leave the forked process
    try check(property, Test.Parameters.default.withMinSuccessfulTests(cases).withInitialSeed(seed))
    catch {
      case failure: TestFailedException => fail(s"with PROPERTY_SEED=${seed.toBase64}: ${failure.getMessage}")
    }
  }
}
